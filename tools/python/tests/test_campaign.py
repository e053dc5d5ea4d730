"""Campaigns: the same to the last digit however they are divided, and whoever dies.

promise: dask
"""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from typing import TYPE_CHECKING

import pytest
from distributed import Client, LocalCluster

import ftc_fmu as ftc

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

RUNS = 120


@pytest.fixture(scope="module")
def alone(paper: ftc.Design) -> ftc.Campaign:
    """The campaign in this process, in one thread."""
    return ftc.campaign(paper, runs=RUNS, seed=9, jobs=1)


@pytest.fixture
def client() -> Iterator[Client]:
    """Two processes with one thread each."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client


def test_threads_do_not_matter(paper: ftc.Design, alone: ftc.Campaign) -> None:
    """Nor does who asks; another seed does."""
    assert ftc.campaign(paper, runs=RUNS, seed=9, jobs=2) == alone
    assert ftc.campaign(paper, runs=RUNS, seed=10) != alone
    assert alone.runs == RUNS


def test_a_cluster_gives_the_same(paper: ftc.Design, alone: ftc.Campaign, client: Client) -> None:
    """To the last digit."""
    assert ftc.campaign(paper, runs=RUNS, seed=9, client=client) == alone


@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_dies_loses_no_run(paper: ftc.Design, alone: ftc.Campaign, client: Client) -> None:
    """Killed in the middle of its work, without a word."""
    victim = client.submit(os.getpid, pure=False).result()
    begun = threading.Event()
    killed = []

    def kill() -> None:
        begun.wait(30.0)
        os.kill(victim, signal.SIGKILL)
        killed.append(time.monotonic())

    thread = threading.Thread(target=kill)
    thread.start()
    heard = []

    def told(what: str, _seconds: float) -> None:
        heard.append(what)
        begun.set()

    whole = ftc.campaign(paper, runs=RUNS, seed=9, client=client, progress=told)
    done = time.monotonic()
    thread.join()
    assert killed
    assert killed[0] < done, "the worker must die while the campaign runs"
    assert whole == alone
    assert whole.runs == RUNS


def test_what_is_written(alone: ftc.Campaign, tmp_path: Path) -> None:
    """Counts for a program, a page for a person."""
    counts, page = alone.save(tmp_path)
    assert json.loads(counts.read_text())["runs"] == RUNS
    assert "<svg" in page.read_text()
    assert "over told" in str(alone)
    assert repr(alone) == f"<ftc_fmu.Campaign of paper: {RUNS} runs>"


def test_an_option_that_is_unknown_or_out_of_range(paper: ftc.Design) -> None:
    """Is refused before anything is run."""
    with pytest.raises(ftc.DesignFileError, match="model_error is 2"):
        ftc.campaign(paper, runs=10, model_error=2.0)
    with pytest.raises(ftc.DesignFileError, match=r"unknown field `model_err`, expected one of .*`model_error`"):
        ftc.campaign(paper, runs=10, model_err=0.1)
    for runs in (0, -1, 1.5, "many"):
        with pytest.raises(ftc.DesignFileError, match=r"runs is .*: give a whole number from 1 on"):
            ftc.campaign(paper, runs=runs)
    with pytest.raises(ftc.DesignFileError, match=r"client is of type str: give a dask\.distributed\.Client"):
        ftc.campaign(paper, runs=10, client="tcp://somewhere")
