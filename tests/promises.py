"""Every row of README's table "What it promises" is kept by a test, and every test keeps a known row.

A row begins with its id in back-quotes. What keeps it says `promise: ID` alone on a line of the doc or comment of a
test function, Rust's `#[test]` or Python's `test_...`, or of a file all of whose tests keep it; then the file names no
other. A test function must assert, itself or by a helper that it calls; a fuzz target and a program of PROGRAMS fail as
a whole. Fails when a row has no test, when a test names an unknown row, when something else names a row, or when a file
that a row names does not exist or does not say so.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
HEADING = "## What it promises"
ROW = re.compile(r"^\| `([a-z0-9-]+)` \|.*\| ([^|]*) \|$", re.MULTILINE)
MARKER = re.compile(r"^\W*promise: ([a-z0-9-]+)\W*$", re.MULTILINE)
SUFFIXES = (".rs", ".py", ".c", ".cpp")
# Programs that end with an error where a promise is broken, and who runs them.
PROGRAMS = {
    "fmu/host/examples/soak.rs": "Makefile",
    "tests/browser/check_pages.py": "Makefile",
    "tests/platforms/compare.py": "Makefile",
}
ENDS = re.compile(r"sys\.exit|SystemExit|\bassert")

RUST_ASSERTS = re.compile(r"\b(?:prop_)?assert(?:_eq|_ne)?!|\bpanic!|\bassert_\w+\(|\.(?:unwrap|expect)_err\(")
RUST_FUNCTION = re.compile(
    r"((?:^[ \t]*(?://[^\n]*|#\[[^\n]*(?:\n[^\n#]*?\])?)\n)*)^[ \t]*(?:pub(?:\([a-z]+\))? )?(?:const )?fn (\w+)",
    re.MULTILINE,
)
# Strings and characters, which may hold braces.
RUST_QUOTED = re.compile(r'r(#*)".*?"\1|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'', re.DOTALL)


def promised() -> dict[str, list[str]]:
    """Ids of the rows, and the files that each row names."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = readme[readme.index(HEADING) :].split("\n## ", 1)[0]
    lines = [line for line in table.splitlines() if line.startswith("| ")]
    rows = ROW.findall(table)
    if len(rows) != len(lines) - 1:
        sys.exit(f"README.md: {len(lines) - 1} rows under '{HEADING}', but {len(rows)} begin with an id")
    return {name: re.findall(r"`([^` ]+\.(?:rs|py|c))`", where) for name, where in rows}


class Function:
    """A function of a file: what is said of it, and whether it asserts."""

    def __init__(self, name: str, doc: str, *, test: bool, asserts: bool, calls: set[str]) -> None:
        """Keeps all of it."""
        self.name = name
        self.promises = MARKER.findall(doc)
        self.test = test
        self.asserts = asserts
        self.calls = calls


def rust_functions(text: str) -> list[Function]:
    """Those of a Rust file; comments in a body belong to what is said of it."""
    blank = RUST_QUOTED.sub(lambda quoted: re.sub(r"[^\n]", " ", quoted[0]), text)
    found = []
    for match in RUST_FUNCTION.finditer(blank):
        start = blank.find("{", match.end())
        depth, end = 1, start + 1
        while depth and end < len(blank):
            depth += {"{": 1, "}": -1}.get(blank[end], 0)
            end += 1
        body = blank[start:end]
        code = re.sub(r"//[^\n]*", "", body)
        found.append(
            Function(
                match[2],
                match[1] + body,
                test="#[test]" in match[1],
                asserts=bool(RUST_ASSERTS.search(code)),
                calls=set(re.findall(r"\b(\w+)(?:::<[^>]*>)?\(", code)),
            )
        )
    return found


def python_functions(text: str) -> list[Function]:
    """Those of a Python file."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.FunctionDef):
            continue
        inside = list(ast.walk(node))
        called = [call.func for call in inside if isinstance(call, ast.Call)]
        calls = {func.id if isinstance(func, ast.Name) else getattr(func, "attr", "") for func in called}
        asserts = any(isinstance(part, ast.Assert) for part in inside)
        asserts = asserts or "raises" in calls or any(name.startswith("assert_") for name in calls)
        doc = ast.get_docstring(node) or ""
        test = node.name.startswith("test_")
        found.append(Function(node.name, doc, test=test, asserts=asserts, calls=calls))
    return found


def functions(name: str, text: str) -> list[Function]:
    """Those of a file."""
    return python_functions(text) if name.endswith(".py") else rust_functions(text)


@cache
def asserting_helpers(folder: Path, suffix: str) -> frozenset[str]:
    """Functions beside a test, and in the folder shared by all, that assert or call one that does."""
    files = [path for place in (folder, ROOT / "tests/support") for path in place.rglob(f"*{suffix}")]
    known = [function for path in files for function in functions(path.name, path.read_text(encoding="utf-8"))]
    asserting = {function.name for function in known if function.asserts}
    while more := {function.name for function in known if function.calls & asserting} - asserting:
        asserting |= more
    return frozenset(asserting)


def check_program(name: str, text: str) -> None:
    """Ends unless the program is run and can fail."""
    if Path(name).stem not in (ROOT / PROGRAMS[name]).read_text(encoding="utf-8"):
        sys.exit(f"{name}: says it keeps a promise, but {PROGRAMS[name]} does not run it")
    if not ENDS.search(text):
        sys.exit(f"{name}: says it keeps a promise, but never ends with an error")


def kept_by(name: str, text: str) -> list[str]:
    """Ids that a file keeps; ends where it only says so."""
    said = MARKER.findall(text)
    if not said:
        return []
    if name in PROGRAMS:
        check_program(name, text)
        return said
    if "fuzz_target!" in text:
        return said
    path = ROOT / name
    known = functions(name, text)
    tests = [function for function in known if function.test]
    helpers = asserting_helpers(path.parent, path.suffix)
    idle = [test.name for test in tests if not (test.asserts or test.calls & helpers)]
    of_tests = [promise for test in tests for promise in test.promises]
    of_file = list(said)
    for promise in of_tests:
        of_file.remove(promise)
    head = re.match(r'(?:\s*//![^\n]*\n)+|\s*"""(?:.*?)"""', text, re.DOTALL)
    stray = [promise for promise in of_file if promise not in MARKER.findall(head[0] if head else "")]
    if stray:
        sys.exit(f"{name}: promise {stray[0]} stands neither at a test nor at the head of the file")
    if len(of_file) > 1:
        sys.exit(f"{name}: keeps {' and '.join(of_file)}: say at each test which of them")
    if of_file and not tests:
        sys.exit(f"{name}: says it keeps {of_file[0]}, but has no test")
    blamed = [test.name for test in tests if test.name in idle and (of_file or test.promises)]
    if blamed:
        sys.exit(f"{name}: {blamed[0]} keeps a promise, but asserts nothing")
    return said


def kept() -> dict[str, set[str]]:
    """Ids that tests keep, and their files."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True)
    found: dict[str, set[str]] = {}
    for name in listed.stdout.decode().splitlines():
        path = ROOT / name
        if not name.endswith(SUFFIXES) or path == Path(__file__) or not path.is_file():
            continue
        for promise in kept_by(name, path.read_text(encoding="utf-8")):
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
