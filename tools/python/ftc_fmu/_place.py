"""Where the package keeps the FMU binaries it packs into exports."""

from pathlib import Path

HOME = str(Path(__file__).resolve().parent)
