"""What the FMU binaries ask of the machine they run on.

promise: three-platforms
"""

from __future__ import annotations

import platform
import re
from typing import TYPE_CHECKING

import pytest

import commands
import elf

if TYPE_CHECKING:
    from pathlib import Path

RELEASE = commands.ROOT / "target" / "release"
PACKED = sorted((RELEASE / "fmu-binaries").glob("*linux*/ftc_*.so"))
# The glibc that tools/platforms/build.sh asks of each platform.
OLDEST = {"linux64": (2, 17), "aarch64-linux": (2, 17)}
# What the newest glibc holds in one library, an old one keeps in several.
PORTABLE = [path for path in PACKED if "libpthread.so.0" in elf.read(path).needed]
SYSTEM = re.compile(r"(libc|libm|libgcc_s|libpthread|libdl|ld-linux[-a-z0-9_]*)\.so\.[0-9]")
HEADER = commands.ROOT / "tests" / "c" / "fmi2_host.h"


def _standard() -> set[str]:
    """Returns the functions of the standard, as the C host declares them."""
    table = HEADER.read_text()
    table = table[table.index("#define FMI2_LOOP(X)") : table.index("typedef struct {\n    void *library")]
    return {f"fmi2{name}" for name in re.findall(r"\bX\((\w+)", table)}


@pytest.mark.skipif(platform.system() != "Linux", reason="reads the binaries of a Linux machine")
def test_a_build_leaves_both_binaries() -> None:
    """Controller and plant are there, so that the tests below are about something."""
    assert {"ftc_controller.so", "ftc_plant.so"} <= {path.name for path in PACKED}
    assert len(_standard()) == 44


@pytest.mark.parametrize("path", PACKED, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_a_binary_offers_the_standard_and_needs_the_system_only(path: Path) -> None:
    """Exactly the standard's functions are visible, and only the C library's parts are needed."""
    library = elf.read(path)
    assert library.exported == _standard()
    assert [name for name in library.needed if not SYSTEM.fullmatch(name)] == []


@pytest.mark.parametrize("path", PACKED, ids=str)
def test_no_elementary_function_comes_from_the_machine(path: Path) -> None:
    """Each C library rounds its own way: the bits would depend on where an FMU runs.

    The plant's noise is the one exception, of which docs/platforms.md tells.
    """
    mathematics = {"sin", "cos", "tan", "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "pow", "hypot"}
    mathematics |= {"asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "cbrt", "sincos", "tgamma", "lgamma"}
    assert mathematics & set(elf.read(path).imported) == (set() if path.stem == "ftc_controller" else {"exp", "log"})


@pytest.mark.skipif(not PORTABLE, reason="the portable binaries are built by make fmu-linux64")
def test_portable_binaries_run_on_an_old_system() -> None:
    """No symbol is newer than glibc 2.17, or than what a platform began with."""
    newest = {path: elf.read(path).glibc for path in PORTABLE}
    assert {path: version for path, version in newest.items() if version > OLDEST[path.parent.name]} == {}
