"""Every file and symbol that the guides name in back-quotes is there; names are the field's.

The guides are CONTRIBUTING.md, ARCHITECTURE.md and docs/paper.md.
A file may be named by the end of its path; one that the program writes is named by the sources. A symbol
named in a numbered step must stand in a file that the step names; any other, somewhere in the sources. Names and
phrases that were metaphors, and were replaced by terms of the field, must not come back.
"""

from __future__ import annotations

import re
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).parents[1]
GUIDES = ("CONTRIBUTING.md", "ARCHITECTURE.md", "docs/paper.md")
STEP = re.compile(r"^\d+\. .*(?:\n {3}.*)*", re.MULTILINE)
FILE = re.compile(r"[\w*./-]*/[\w*.-]*|[\w*-]+\.(?:rs|py|sh|md|toml|json)|Makefile")
# Metaphors that names, comments and messages once held.
METAPHORS = re.compile(
    rb"\b(?:Dice|dice|Lottery|lottery|hasty|blip|bearable|SILENCE|ROOM|HASTE|Road|Contender|slowest_step|thickened"
    rb"|Trust|Truth|Play|Frame|lives on|leans on|hair of the|beyond suspicion|usual ways out|fault that hides"
    rb"|played|struck|aside|Loosen|Tighten|leans_on_the_model|has_come_to_nothing|undisputed|calmer)\b"
)
SYMBOL = re.compile(r"[A-Za-z_]\w*(?:::\w+)*")


def main() -> None:
    """Prints what is named and not there."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True)
    files = [name for name in listed.stdout.decode().splitlines() if name not in GUIDES and (ROOT / name).is_file()]
    texts = {name: (ROOT / name).read_bytes() for name in files}
    words = {name: set(re.findall(rb"\w+", text)) for name, text in texts.items()}
    wrong = []
    for guide in GUIDES:
        text = (ROOT / guide).read_text(encoding="utf-8")
        for part in [*STEP.findall(text), STEP.sub("", text)]:
            named = re.findall(r"`([^`\s]+)`", part)
            places: set[str] = set()
            for name in (name for name in named if FILE.fullmatch(name) and "NAME" not in name and name != "target/"):
                path = f"*/{name.rstrip('/')}"
                ends = [file for file in files if fnmatch(f"/{file}", path) or fnmatch(f"/{file}", f"{path}/*")]
                places.update(ends)
                written = any(f'"{name}"'.encode() in text for text in texts.values())
                wrong += [] if ends or written else [f"{guide}: no file {name}"]
            within = places if re.match(r"\d", part) and places else set(files)
            known = set().union(*(words[file] for file in within))
            for name in (name for name in named if SYMBOL.fullmatch(name) and not FILE.fullmatch(name)):
                missing = [piece for piece in name.split("::") if piece.encode() not in known]
                wrong += [f"{guide}: no {piece} (of {name}) in what is named beside it" for piece in missing]
    sources = [name for name in files if name.endswith((".rs", ".py", ".c")) and ROOT / name != Path(__file__)]
    for name in sources:
        for number, line in enumerate(texts[name].splitlines(), 1):
            if found := METAPHORS.search(line):
                wrong.append(f"{name}:{number}: say '{found[0].decode()}' in a term of the field")
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
