"""Designs: made from a plant, or read from a file; simulated, exported, run."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

from ftc_fmu import _core
from ftc_fmu._place import HOME
from ftc_fmu._plain import count, plain, table, to_toml, whole
from ftc_fmu.controller import Controller
from ftc_fmu.errors import DesignFileError
from ftc_fmu.log import Log
from ftc_fmu.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from os import PathLike

    from ftc_fmu.plant import Plant

    Progress = bool | Callable[[str, float], None] | None

SECTIONS = ("disturbance", "observer", "estimator", "compensation", "scenario")


class Design:
    """A controller with its proof, ready to simulate, run and export.

    Made by `ftc_fmu.design` or `ftc_fmu.load`.

    Attributes:
        document: The design file as a dictionary.
        report: What `ftc-fmu design --json` prints: `gamma`, `spectral_radius`, `observer`, ...
        warnings: What is sound but worth knowing, one sentence each.
    """

    def __init__(self, core: _core.Design, document: dict[str, Any], folder: Path) -> None:
        """Wraps what was solved."""
        self.core = core
        self._folder = folder
        self.document = document
        self.report: dict[str, Any] = json.loads(core.json())
        self.warnings: list[str] = core.warnings()

    @property
    def name(self) -> str:
        """Name of the design; it names the FMUs."""
        return self.document["name"]

    @property
    def sample_time(self) -> float:
        """Seconds between two samples."""
        return float(self.document["sample_time"])

    def record(self) -> dict[str, Any]:
        """Returns the design with every gain and matrix, and under `proof` what proves it."""
        return json.loads(self.core.record())[0]

    def to_toml(self) -> str:
        """Returns the design file; `ftc_fmu.load` of it makes the same design."""
        return to_toml(self.document)

    def save(self, path: str | PathLike[str]) -> Path:
        """Writes the design file and, beside it, the files that it names: matrices, logs and tables.

        Returns:
            The path of the design file.
        """
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        for file in _files(self.document):
            source, target = self._folder / file, path.parent / file
            if source.exists() and source.resolve() != target.resolve():
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(source.read_bytes())
        path.write_text(self.to_toml(), encoding="utf-8")
        return path

    def simulate(self, scenario: Mapping[str, Any] | None = None, *, baselines: bool = False) -> Run:
        """Runs the closed loop: with fault tolerance, without, and told the true fault.

        Args:
            scenario: `[scenario]` of a design file in place of the design's own: `steps`, `noise`,
                `seed`, `schedule`, `reference` (r signals), `fault` (p signals), `events`,
                `disturbance` (s signals); a signal is a number or a table with a `kind`. `plant` is the
                true plant: a table, or a `Plant` at the design's sample time. The controller stays as
                it is.
            baselines: Run also the paper's additive control and model predictive control.

        Returns:
            The trajectories and figures of merit.

        Raises:
            DesignFileError: One sentence about the scenario.
        """
        text = None
        if scenario is not None:
            told = _scenario(scenario, self.sample_time)
            text = to_toml(self.document | {"scenario": plain(told, "scenario")})
        return Run(self.core.simulate(text, str(self._folder), baselines))

    def export(
        self,
        out: str | PathLike[str],
        *,
        fmi: str = "2.0",
        platforms: Sequence[str] | None = None,
        ssp: bool = False,
        sign: str | PathLike[str] | None = None,
    ) -> list[Path]:
        """Writes NAME_controller.fmu and NAME_plant.fmu, and with `ssp` the package of both.

        The plant FMU runs the design's own scenario, not one that was given to `simulate`.

        Args:
            out: Folder; made where there is none.
            fmi: Version of the interface; only "2.0" is there.
            platforms: Which of `ftc_fmu.platforms()` to pack; all by default.
            ssp: Also write NAME.ssp, both FMUs connected (SSP 1.0).
            sign: Secret key file of minisign that signs the FMUs; its password, if any, is taken
                from the environment variable FTC_FMU_KEY_PASSWORD.

        Returns:
            The paths that were written.

        Raises:
            DesignFileError: One sentence about a keyword or the folder; nothing was written.
        """
        if fmi != "2.0":
            raise DesignFileError(f'fmi is "{fmi}": FMUs of version "2.0" are written, no other', "fmi")
        wanted = [platforms] if isinstance(platforms, str) else None if platforms is None else list(platforms)
        key = None if sign is None else str(Path(sign))
        return [Path(path) for path in self.core.export(str(Path(out)), HOME, ssp, wanted, key)]

    def controller(self) -> Controller:
        """Returns the controller itself: the code that runs in the FMU, at rest in mode 1."""
        return Controller(self.core.controller())

    def __reduce__(self) -> tuple:
        """Pickles what was solved, so that no worker solves again."""
        return _restored, (self.core.record(), self.document, str(self._folder))

    def __str__(self) -> str:
        """Returns the report that `ftc-fmu design` prints."""
        return self.core.text()

    def __repr__(self) -> str:
        """Returns one line: name, modes, gains."""
        modes = self.document.get("mode") or self.report.get("gamma") or []
        return f"<ftc_fmu.Design {self.name}: {count(len(modes), 'mode')}, gamma {self.report.get('gamma')}>"

    def _repr_html_(self) -> str:
        """Shows the report in a notebook."""
        return self.core.html()


def design(
    plant: Plant,
    *,
    name: str = "design",
    progress: Progress = None,
    threads: int = 1,
    **keys: Any,  # noqa: ANN401
) -> Design:
    """Designs, certifies and returns a controller for a plant.

    Args:
        plant: The plant.
        name: Names the FMUs: letters, digits, underscores.
        progress: `True` prints what is going on and for how long; a function is called with
            both, about once a second, and may raise to stop waiting.
        threads: How many independent parts are worked on at the same time, such as the modes under
            `lyapunov="dwell"`; the design does not depend on it.
        **keys: Keys of the design file, with the same names and defaults. Those of `[controller]`
            stand alone (`tracked`, `latency`, `lyapunov`, `decay`, `output_weight`, ...); the
            tables `disturbance`, `observer`, `estimator`, `compensation` and `scenario` are
            dictionaries. `tracked` may name outputs or count them from 1. `estimator["database"]`
            may be a `Log`, or one per mode.

    Returns:
        The design with its proof.

    Raises:
        DesignFileError: The request is ill-formed: `key` says where.
        Infeasible: There is no such controller: `blocks` and `advice` say why and what to do.
        Uncertified: Gains were found but not proved.
    """
    if not hasattr(plant, "document"):
        raise DesignFileError(f"plant is of type {type(plant).__name__}: give an ftc_fmu.Plant", "plant")
    document: dict[str, Any] = {"name": name} | plant.document()
    given = {key: keys.pop(key) for key in SECTIONS if key in keys}
    tables = {key: table(value, key) for key, value in given.items() if value is not None}
    control = table(keys.pop("controller", {}), "controller") | keys
    if "tracked" in control:
        control["tracked"] = _tracked(control["tracked"], plant)
    if "scenario" in tables:
        tables["scenario"] = _scenario(tables["scenario"], plant.sample_time)
    folder, tables = _with_logs(tables)
    if control:
        document["controller"] = plain(control, "controller")
    document |= {key: plain(entries, key) for key, entries in tables.items()}
    core = _core.solve(to_toml(document), str(folder), None, listener(progress), whole(threads, "threads", 1))
    return Design(core, document, folder)


def load(path: str | PathLike[str], *, progress: Progress = None, threads: int = 1) -> Design:
    """Reads a design file and makes its design.

    Args:
        path: Design file (TOML); logs and tables are sought beside it.
        progress: As in `design`.
        threads: As in `design`.

    Raises:
        DesignFileError: The file is at fault: `key` and `line` say where.
        Infeasible: There is no such controller.
        Uncertified: Gains were found but not proved.
    """
    path = Path(path)
    text = _core.read_text(str(path))
    core = _core.solve(text, str(path.parent), str(path), listener(progress), whole(threads, "threads", 1))
    return Design(core, tomllib.loads(text.removeprefix("\ufeff")), path.parent)


def _restored(record: bytes, document: dict[str, Any], folder: str) -> Design:
    return Design(_core.restore(record), document, Path(folder))


def listener(progress: Progress) -> Callable[[str, float], None] | None:
    """Returns what to call with progress: one's own function, or one that prints."""
    if progress is True:
        return lambda what, seconds: print(f"{what} ({seconds:.0f} s)", flush=True)
    return progress or None


def _scenario(given: Mapping[str, Any], sample_time: float) -> dict[str, Any]:
    """A scenario whose true plant is a table, also where it was given as a `Plant`."""
    scenario = table(given, "scenario")
    truth = scenario.get("plant")
    if not hasattr(truth, "truth"):
        return scenario
    if truth.sample_time != sample_time:
        raise DesignFileError(
            f"scenario.plant has a sample time of {truth.sample_time} s, the design one of {sample_time} s: "
            "give it at the design's",
            "scenario.plant",
        )
    return scenario | {"plant": truth.truth()}


def _tracked(given: Sequence[int | str], plant: Plant) -> list[int]:
    """Numbers of the tracked outputs, from 1, as the design file counts."""
    named = [table.get("name", f"y[{number}]") for number, table in enumerate(plant.signals.get("outputs", []), 1)]
    named = named or [f"y[{number}]" for number in range(1, len(plant.modes[0].C) + 1)]
    numbers = []
    for entry in [given] if isinstance(given, int | str) else given:
        if isinstance(entry, str) and entry not in named:
            raise DesignFileError(
                f'controller.tracked names "{entry}", the outputs are {", ".join(named)}: name one of them',
                "controller.tracked",
            )
        numbers.append(named.index(entry) + 1 if isinstance(entry, str) else whole(entry, "controller.tracked", 1))
    return numbers


def _with_logs(tables: dict[str, Any]) -> tuple[Path, dict[str, Any]]:
    """Writes logs that are objects into a folder of their own and names them in the tables."""
    estimator = tables.get("estimator", {})
    database = estimator.get("database")
    logs = [database] if isinstance(database, Log) else database
    if not isinstance(logs, list | tuple) or not all(isinstance(log, Log) for log in logs):
        return Path.cwd(), tables
    folder = Path(mkdtemp(prefix="ftc-fmu-"))
    names = [f"log_{number}.csv" for number in range(1, len(logs) + 1)]
    for log, file in zip(logs, names, strict=True):
        log.to_csv(folder / file)
    files = names[0] if isinstance(database, Log) else names
    return folder, tables | {"estimator": {**estimator, "database": files}}


def _files(document: dict[str, Any]) -> list[str]:
    """Files that a design file names: matrices of modes, logs, tables of a scenario."""
    database = document.get("estimator", {}).get("database")
    logs = [database] if isinstance(database, str) else database or []
    return [file for file in logs if file not in ("commission", "model")] + list(
        _named([document.get("mode"), document.get("scenario")])
    )


def _named(value: object) -> Iterator[str]:
    """Every text under a key `file`, however deep."""
    if isinstance(value, dict):
        if isinstance(value.get("file"), str):
            yield value["file"]
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            yield from _named(item)
