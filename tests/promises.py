"""Every row of README's table "What it promises" is kept by a test, and every test keeps a known row.

A row begins with its id in back-quotes. A test that keeps it says `promise: ID` in a comment or doc string,
alone on its line. Fails when a row has no test, when a test names an unknown row, when a file that says so tests
nothing, or when a file that a row names does not exist or does not say so.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
HEADING = "## What it promises"
ROW = re.compile(r"^\| `([a-z0-9-]+)` \|.*\| ([^|]*) \|$", re.MULTILINE)
MARKER = re.compile(r"^\W*promise: ([a-z0-9-]+)\W*$", re.MULTILINE)
TESTS = re.compile(r"#\[test\]|proptest!|fuzz_target!|\bassert|def test_|sys\.exit|SystemExit")
SUFFIXES = (".rs", ".py", ".c", ".cpp")


def promised() -> dict[str, list[str]]:
    """Ids of the rows, and the files that each row names."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = readme[readme.index(HEADING) :].split("\n## ", 1)[0]
    lines = [line for line in table.splitlines() if line.startswith("| ")]
    rows = ROW.findall(table)
    if len(rows) != len(lines) - 1:
        sys.exit(f"README.md: {len(lines) - 1} rows under '{HEADING}', but {len(rows)} begin with an id")
    return {name: re.findall(r"`([^` ]+\.(?:rs|py|c))`", where) for name, where in rows}


def kept() -> dict[str, set[str]]:
    """Ids that files claim to keep, and these files."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True)
    found: dict[str, set[str]] = {}
    for name in listed.stdout.decode().splitlines():
        path = ROOT / name
        if not name.endswith(SUFFIXES) or path == Path(__file__) or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8")
        for promise in MARKER.findall(text):
            if not TESTS.search(text):
                sys.exit(f"{name}: says it keeps {promise}, but asserts nothing")
            found.setdefault(promise, set()).add(name)
    return found


def faults(rows: dict[str, list[str]], tests: dict[str, set[str]]) -> list[str]:
    """What does not fit, one sentence each."""
    unkept = [f"README.md: no test says 'promise: {name}'" for name in rows if name not in tests]
    unknown = [
        f"{file}: promise {name} is no row of README.md"
        for name, files in tests.items()
        for file in sorted(files)
        if name not in rows
    ]
    silent = [
        f"README.md: {name} names {file}, which does not say 'promise: {name}'"
        for name, files in rows.items()
        for file in files
        if file not in tests.get(name, ()) and "*" not in file
    ]
    return unkept + unknown + silent


if __name__ == "__main__":
    found = faults(promised(), kept())
    if found:
        sys.exit("\n".join(found))
