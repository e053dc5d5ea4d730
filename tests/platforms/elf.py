"""What a Linux library needs and offers, as readelf tells it."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Library:
    """Dynamic symbols and dependencies of a shared library."""

    needed: frozenset[str]
    imported: dict[str, str]
    exported: frozenset[str]

    @property
    def glibc(self) -> tuple[int, ...]:
        """The newest version of glibc that a symbol asks for."""
        versions = (re.fullmatch(r"GLIBC_([0-9.]+)", version) for version in self.imported.values())
        return max(tuple(map(int, version[1].split("."))) for version in versions if version)


def read(path: Path) -> Library:
    """Reads the dynamic section and symbol table of a library."""
    readelf = shutil.which("readelf")
    assert readelf, "readelf is missing: install binutils"
    text = subprocess.run([readelf, "-dW", "--dyn-syms", path], capture_output=True, text=True, check=True).stdout
    imported, exported = {}, set()
    for line in text.splitlines():
        symbol = re.match(r"\s*\d+: [0-9a-f]+\s+\w+ \w+\s+(GLOBAL|WEAK)\s+\w+\s+(\w+) ([^@\s]+)(?:@+(\S+))?", line)
        if symbol and symbol[2] == "UND":
            imported[symbol[3]] = symbol[4] or ""
        elif symbol:
            exported.add(symbol[3])
    needed = frozenset(re.findall(r"\(NEEDED\).*\[(.*)\]", text))
    return Library(needed, imported, frozenset(exported))
