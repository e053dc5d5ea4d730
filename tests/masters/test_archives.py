"""What is in an exported archive, whoever opens it.

promise: reproducible-export
"""

from __future__ import annotations

import re
import zipfile
from typing import TYPE_CHECKING

import commands

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Case


def test_the_same_design_gives_the_same_bytes(example_case: Callable[[str], Case], tmp_path: Path) -> None:
    """Two exports of one design are equal to the byte, the package too."""
    case = example_case("paper_latency")
    again = commands.export(case.path, tmp_path)
    for name in ("controller", "plant", "package"):
        assert getattr(again, name).read_bytes() == getattr(case.fmus, name).read_bytes()


def test_an_fmu_brings_its_papers(example_case: Callable[[str], Case]) -> None:
    """Each FMU holds a page about its design, licences and an icon, and no path leads out of it."""
    case = example_case("paper_latency")
    for fmu in (case.fmus.controller, case.fmus.plant):
        with zipfile.ZipFile(fmu) as archive:
            assert archive.testzip() is None
            names = archive.namelist()
            assert names == sorted(names)
            assert {"documentation/index.html", "documentation/licenses/license.txt", "model.png"} <= set(names)
            assert archive.read("model.png").startswith(b"\x89PNG")
            page = archive.read("documentation/index.html").decode()
            assert "paper_latency" in page
            assert "gamma" in page
            assert page.count("<svg") >= 6
            assert "prefers-color-scheme:dark" in page
            # Self-contained: nothing is fetched, nothing runs.
            assert not re.search(r"<script|<img|url\([^#]|@import|(src|href)=\"(?!#|data:)", page)
            for entry in archive.infolist():
                assert entry.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
                assert entry.date_time == (1980, 1, 1, 0, 0, 0)
                assert "\\" not in entry.filename
                assert ".." not in entry.filename


def test_the_package_holds_the_very_fmus(example_case: Callable[[str], Case]) -> None:
    """The FMUs in the SSP package are those beside it."""
    case = example_case("paper_latency")
    with zipfile.ZipFile(case.fmus.package) as package:
        assert package.namelist()[0] == "SystemStructure.ssd"
        for fmu in (case.fmus.controller, case.fmus.plant):
            assert package.read(f"resources/{fmu.name}") == fmu.read_bytes()
