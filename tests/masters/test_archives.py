"""What is in an exported archive, whoever opens it."""

from __future__ import annotations

import os
import re
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import commands

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Case


def test_the_same_design_gives_the_same_bytes(example_case: Callable[[str], Case], tmp_path: Path) -> None:
    """Two exports of one design are equal to the byte, the package too.

    promise: reproducible-export
    """
    case = example_case("paper_latency")
    again = commands.export(case.path, tmp_path)
    for name in ("controller", "plant", "package"):
        assert getattr(again, name).read_bytes() == getattr(case.fmus, name).read_bytes()


def test_an_fmu_brings_its_papers(example_case: Callable[[str], Case]) -> None:
    """Each FMU holds a page about its design, licences and an icon, and no path leads out of it.

    promise: reproducible-export
    """
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


def test_every_linked_crate_brings_its_licence(example_case: Callable[[str], Case]) -> None:
    """Each crate whose code left its name in the binary is listed, with a licence text; the standard library too.

    promise: licences
    """
    case = example_case("paper_latency")
    for fmu in (case.fmus.controller, case.fmus.plant):
        with zipfile.ZipFile(fmu) as archive:
            papers = archive.read("documentation/licenses/license.txt").decode()
            library = archive.read("documentation/licenses/rust-standard-library.html").decode()
            binary = archive.read(f"binaries/linux64/{fmu.stem}.so")
        listed, *texts = papers.split(f"\n{80 * '='}\n")
        crates = re.findall(r"^  (\S+ \d\S*)  ", listed, flags=re.MULTILINE)
        assert {"nalgebra", "minicbor-serde", "libm", "postcard", "sha2"} <= {crate.split()[0] for crate in crates}
        seen = re.findall(rb"([a-z][a-z0-9_-]*)-(\d+\.\d+\.\d+[a-z0-9.+-]*)/src/", binary)
        assert seen
        names = {crate.split()[0] for crate in crates}
        for name, version in ((name.decode(), version.decode()) for name, version in seen):
            # What the standard library brings along is there in the version that this repository uses.
            assert name in names or f"{name}-{version}" in library
        # The crates a text came with stand in a line of their own before it.
        owners = {owner for line in texts[::2] for owner in line.split(", ")}
        assert set(crates) | {"ftc-fmu"} == owners
        for crate in crates:
            own = [text for of, text in zip(texts[::2], texts[1::2], strict=True) if crate in of.split(", ")]
            # The shortest licence is longer than this; a note that names one is not.
            assert max(map(len, own)) > 500, crate
        assert "Permission is hereby granted" in papers
        assert "Apache License" in papers
        assert "Rust" in library


def test_no_path_of_the_building_machine_is_in_a_binary(example_case: Callable[[str], Case]) -> None:
    """Neither the repository's folder nor cargo's nor the home directory stands in the binaries.

    promise: licences
    """
    case = example_case("paper_latency")
    places = [Path(__file__).parents[2], Path.home(), Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo"))]
    for fmu in (case.fmus.controller, case.fmus.plant):
        with zipfile.ZipFile(fmu) as archive:
            for name in archive.namelist():
                if name.startswith("binaries/"):
                    binary = archive.read(name)
                    for place in places:
                        assert f"{place}/".encode() not in binary, (name, place)


def test_the_package_holds_the_very_fmus(example_case: Callable[[str], Case]) -> None:
    """The FMUs in the SSP package are those beside it."""
    case = example_case("paper_latency")
    with zipfile.ZipFile(case.fmus.package) as package:
        assert package.namelist()[0] == "SystemStructure.ssd"
        for fmu in (case.fmus.controller, case.fmus.plant):
            assert package.read(f"resources/{fmu.name}") == fmu.read_bytes()
