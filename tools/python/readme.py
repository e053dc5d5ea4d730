"""Runs the Python lines of README as a new user would: in an empty folder, one block after the other.

python readme.py README.md FOLDER
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path


def main() -> None:
    """Runs every indented block that begins with an import of the package."""
    readme, folder = Path(sys.argv[1]).read_text(encoding="utf-8"), Path(sys.argv[2])
    blocks = re.findall(r"(?:^    .*\n|^\n)+", readme, re.MULTILINE)
    code = [re.sub(r"^    ", "", block, flags=re.MULTILINE) for block in blocks]
    code = [block for block in code if "import ftc_fmu" in block]
    if not code:
        raise SystemExit("README has no Python example")
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    scope: dict[str, object] = {}
    for block in code:
        exec(compile(block, "README.md", "exec"), scope)  # noqa: S102  (that is what it is for)
    if not list(Path().rglob("*_controller.fmu")):
        raise SystemExit("README's example wrote no FMU")
    print(f"README's {len(code)} Python example runs")


if __name__ == "__main__":
    main()
