"""Thousands of seeded random runs of a design, here or on a Dask cluster, with the same result to the last digit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftc_fmu import _core
from ftc_fmu._plain import count, plain, whole
from ftc_fmu.design import Design, listener
from ftc_fmu.errors import DesignFileError, FtcError, extra

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from distributed import Client

# Shards per thread of a cluster: enough that a slow or lost worker delays little.
SHARDS_PER_THREAD = 4
# How often a shard is given to another worker when its worker dies.
RETRIES = 20


class Campaign:
    """Statistics of many runs with random faults, schedules, references, noise and model errors.

    Attributes:
        report: Quantiles of the true error, detection delays, false alarms, isolation, the worst runs.
        runs: Runs that were done.
    """

    def __init__(self, design: Design, part: bytes, asked: int) -> None:
        """Wraps what was counted."""
        self._design = design
        self._part = part
        self._asked = asked
        self.report: dict[str, Any] = json.loads(_core.campaign_json(part, asked))
        self.runs: int = self.report["runs"]

    def __eq__(self, other: object) -> bool:
        """Says whether every count and every number is the same."""
        return isinstance(other, Campaign) and self._part == other._part

    __hash__ = None  # results are compared, not looked up

    def save(self, out: str | PathLike[str]) -> list[Path]:
        """Writes campaign.json and campaign.html into a folder; returns their paths."""
        return [Path(path) for path in self._design.core.campaign_save(self._part, self._asked, Path(out))]

    def __repr__(self) -> str:
        """Returns one line: the design and the runs."""
        return f"<ftc_fmu.Campaign of {self._design.name}: {count(self.runs, 'run')}>"

    def __str__(self) -> str:
        """Returns the figures a person looks at first, as the command line's table."""
        return _core.campaign_text(self._part).rstrip("\n")

    def _repr_html_(self) -> str:
        """Shows the page with its distributions in a notebook."""
        return self._design.core.campaign_html(self._part, self._asked)


def campaign(
    design: Design,
    runs: int = _core.RUNS,
    *,
    client: Client | None = None,
    jobs: int | None = None,
    progress: bool | Callable[[str, float], None] | None = None,
    **options: float,
) -> Campaign:
    """Does `runs` random runs of a design and counts what came of them.

    Run `i` depends on the design, the options and `i` alone, and only counts are added up, so that
    the result is the same to the last digit for any number of threads, workers or shards.

    Args:
        design: The design.
        runs: Number of runs.
        client: A `dask.distributed.Client`: runs on its workers. A worker that dies loses no run and
            counts none twice.
        jobs: Threads, without a client; all processors by default.
        progress: As in `ftc_fmu.design`.
        **options: `seed`, `model_error` (largest relative error of the matrices), `largest_fault` (in
            thresholds), `most_faults` (in one run).

    Raises:
        DesignFileError: An option is out of range.
        FtcError: The cluster could not finish.
    """
    runs = whole(runs, "runs", 1)
    jobs = None if jobs is None else whole(jobs, "jobs", 1)
    said = json.dumps(plain(options, ""))
    if client is None:
        part = design.core.campaign(said, 0, runs, jobs, listener(progress))
        return Campaign(design, part, runs)
    return Campaign(design, _on_cluster(design, runs, said, client, listener(progress)), runs)


def _shard(record: bytes, options: str, first: int, last: int) -> bytes:
    """Does some runs on a worker, in the one thread that it gives."""
    return _core.restore(record).campaign(options, first, last, 1, None)


def _on_cluster(
    design: Design,
    runs: int,
    options: str,
    client: Client,
    told: Callable[[str, float], None] | None,
) -> bytes:
    distributed = extra("distributed", "dask")
    if not isinstance(client, distributed.Client):
        raise DesignFileError(f"client is of type {type(client).__name__}: give a dask.distributed.Client", "client")
    design.core.campaign(options, 0, 0, 1, None)  # refuses options before anything is sent
    threads = max(1, sum(client.nthreads().values()))
    count = max(1, min(runs, SHARDS_PER_THREAD * threads))
    bounds = [runs * index // count for index in range(count + 1)]
    record = design.core.record()
    futures = {}
    for index in range(count):
        future = client.submit(_shard, record, options, bounds[index], bounds[index + 1], pure=False, retries=RETRIES)
        futures[future] = index
    parts: dict[int, bytes] = {}
    tries = dict.fromkeys(range(count), 0)
    waiting = distributed.as_completed(futures)
    try:
        for future in waiting:
            index = futures[future]
            try:
                parts[index] = future.result()
            except distributed.KilledWorker as error:
                # The scheduler gives a task up after a few deaths; they were not this task's doing.
                tries[index] += 1
                if tries[index] > RETRIES:
                    raise FtcError(f"runs {bounds[index]} to {bounds[index + 1]} killed every worker") from error
                again = client.submit(
                    _shard, record, options, bounds[index], bounds[index + 1], pure=False, retries=RETRIES
                )
                futures[again] = index
                waiting.add(again)
            if told is not None:
                told(f"{len(parts)} of {count} shards", 0.0)
    finally:
        client.cancel([future for future in futures if not future.done()])
    merged = _core.campaign_merge([parts[index] for index in range(count)])
    missing = _core.campaign_missing(merged, runs)
    if missing:
        raise FtcError(f"runs {missing} were not done: check the cluster's workers")
    return merged
