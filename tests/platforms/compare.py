"""Runs one design's loop on every platform that its FMUs are packed for, and compares the bits.

    python tests/platforms/compare.py examples/paper.toml

win64 runs under wine, another processor's Linux under qemu with its C library from Debian's
packages. Ends with an error if any bit differs.

promise: three-platforms
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import c_host
import fmpy

import commands

SOURCE = commands.ROOT / "tests" / "c" / "closed_loop.c"
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-O1"]
ZIG = commands.ROOT / "target" / "platforms" / "zig" / "bin" / "python"
MINGW = ["x86_64-w64-mingw32-gcc", "-D__USE_MINGW_ANSI_STDIO=1"]
WINE = shutil.which("wine64") or "/usr/lib/wine/wine64"
STEPS = 1600

# Linux on other processors: zig's target, what runs its programs, and the processor's name in Debian.
EMULATED = {"aarch64-linux": ("aarch64-linux-gnu.2.17", "qemu-aarch64", "arm64")}


def system_of(platform: str) -> list[str | Path]:
    """Returns the command under which a program of a platform runs here."""
    if platform == "linux64":
        return []
    if platform == "win64":
        return [WINE]
    _, emulator, architecture = EMULATED[platform]
    root = subprocess.run(
        [commands.ROOT / "tools" / "platforms" / "system.sh", architecture],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout.strip()
    return [emulator, "-L", root]


def compile_for(platform: str, program: Path) -> None:
    """Compiles the C program that closes the loop."""
    libraries = ["-ldl"]
    if platform == "linux64":
        compiler = ["cc"]
    elif platform == "win64":
        compiler, libraries = MINGW, []
    else:
        compiler = [ZIG, "-m", "ziglang", "cc", "-target", EMULATED[platform][0]]
    subprocess.run([*compiler, *FLAGS, "-o", program, SOURCE, *libraries], check=True)


def uri(folder: Path, platform: str) -> str:
    """Returns where the resources are, as the platform's importers say it."""
    return f"file:///Z:{folder}" if platform == "win64" else folder.as_uri()


def run(platform: str, fmus: commands.Exported, folder: Path) -> tuple[str, float]:
    """Runs the loop on a platform and returns what it printed and the seconds it took."""
    program = folder / f"closed_loop_{platform}.exe"
    compile_for(platform, program)
    if platform == "win64":
        prng = Path(__file__).with_name("bcryptprimitives.c")
        subprocess.run([*MINGW, "-shared", "-o", folder / "bcryptprimitives.dll", prng, "-ladvapi32"], check=True)
    sides, arguments = {}, []
    for side, fmu in (("c", fmus.controller), ("p", fmus.plant)):
        unpacked = folder / f"{platform}_{side}"
        fmpy.extract(fmu, unpacked)
        sides[side] = fmpy.read_model_description(unpacked)
        (library,) = (unpacked / "binaries" / platform).iterdir()
        path = "Z:" + str(library).replace("/", "\\") if platform == "win64" else library
        arguments += [path, sides[side].guid, uri(unpacked / "resources", platform)]
    size = str(sides["p"].defaultExperiment.stepSize)
    command = [*system_of(platform), program, *arguments, size, str(STEPS), *c_host.connections(sides)]
    start = time.perf_counter()
    environment = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(folder / "wine")}
    text = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=environment).stdout
    return text, time.perf_counter() - start


def main() -> None:
    """Compares every packed platform with this one."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fmus = commands.export(Path(sys.argv[1]), folder)
        with tempfile.TemporaryDirectory(dir=folder) as unpacked:
            packed = sorted(path.name for path in Path(fmpy.extract(fmus.plant, unpacked), "binaries").iterdir())
        results = {}
        for platform in packed:
            text, seconds = run(platform, fmus, folder)
            results[platform] = text.split()
            digest = hashlib.sha256(" ".join(text.split()).encode()).hexdigest()[:16]
            print(f"{platform}: {len(results[platform])} numbers, {digest}, {seconds:.2f} s")
        values = list(results.values())
        if not values[0] or any(other != values[0] for other in values):
            sys.exit("the platforms differ")


if __name__ == "__main__":
    main()
