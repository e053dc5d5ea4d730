"""The command line `ftc-fmu`, also as `python -m ftc_fmu`."""

from __future__ import annotations

import signal
import sys

from ftc_fmu import _core
from ftc_fmu._place import HOME


def main() -> int:
    """Runs the program with this process's arguments and returns its exit code."""
    # The program ends at once where Python would wait for the interpreter's turn.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _core.main(["ftc-fmu", *sys.argv[1:]], HOME, [sys.executable, "-m", "ftc_fmu"])


if __name__ == "__main__":
    sys.exit(main())
