"""A fleet on Dask: the bits of one process, whoever dies, and one sentence for what is wrong."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fleet_logs import effects, fleet_in

from flexspline.errors import InputError
from flexspline.fleet import fit_sums
from flexspline.fleet.accumulators import Plan, RunSums, accumulators_of
from flexspline.fleet.cluster import Failed, Workers, done
from flexspline.fleet.sessions import Session, sessions_of
from flexspline.progress import Progress

distributed = pytest.importorskip("distributed")
PLAN = Plan(tuple(effects()), "sensor_torque")
SUMMED = partial(accumulators_of, plan=PLAN)


def ran(work: Any, tasks: Any, workers: Workers) -> list[Any]:
    return done(work, tasks, workers, Progress("", False))


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, ...]:
    folder = tmp_path_factory.mktemp("line")
    fleet_in(folder, 4, 2)
    (folder / "joint02" / "run3.csv").write_text("time,sensor_torque\n0,1\n0.01,nan\n")
    return sessions_of(folder).sessions


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Two processes that work."""
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as made,
    ):
        yield made


class Dying:
    """Work during which, once, the process that does it is killed as the kernel kills one."""

    def __init__(self, folder: Path, last: str) -> None:
        self.folder, self.last = folder, last

    def __call__(self, session: Session) -> RunSums:
        with (self.folder / session.label.replace("/", "_")).open("a") as file:
            file.write(f"{os.getpid()}\n")
        if session.label == self.last and not (self.folder / "killed").exists():
            (self.folder / "killed").touch()
            time.sleep(1.0)  # what was done before is off the worker by then
            os.kill(os.getpid(), signal.SIGKILL)
        return SUMMED(session)


def same(one: list[RunSums | Failed], other: list[RunSums | Failed]) -> bool:
    for a, b in zip(one, other, strict=True):
        if isinstance(a, Failed) or isinstance(b, Failed):
            if a != b:
                return False
            continue
        equal = np.array_equal(a.packed, b.packed) and a.label == b.label
        if not (equal and np.array_equal(a.total.high, b.total.high)):
            return False
        if not np.array_equal(a.total.low, b.total.low):
            return False
    return True


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such signal")
def test_a_worker_that_is_killed_costs_its_run_and_no_number(
    client: Any, sessions: tuple[Session, ...], tmp_path: Path
) -> None:
    alone = ran(SUMMED, sessions, Workers(count=0))
    killed = ran(Dying(tmp_path, sessions[3].label), sessions, Workers(client))
    assert (tmp_path / "killed").exists()
    assert same(alone, killed)
    tries = {s.label: (tmp_path / s.label.replace("/", "_")).read_text().split() for s in sessions}
    assert len(set(tries[sessions[3].label])) == 2  # by two processes
    assert sum(map(len, tries.values())) == len(sessions) + 1
    one, other = (
        fit_sums([run for run in made if isinstance(run, RunSums)], PLAN).to_json()
        for made in (alone, killed)
    )
    assert one == other


def test_two_workers_by_their_address_give_the_bits_of_none(
    client: Any, sessions: tuple[Session, ...]
) -> None:
    alone = ran(SUMMED, sessions, Workers(count=0))
    assert same(alone, ran(SUMMED, sessions, Workers(client.scheduler.address)))
    failed = [each for each in alone if isinstance(each, Failed)]
    assert len(failed) == 1 and "run3" in failed[0].why


def test_a_defect_is_no_wrong_run(client: Any) -> None:
    with pytest.raises(ZeroDivisionError):
        ran(_defect, [1], Workers(client))
    with pytest.raises(ZeroDivisionError):
        ran(_defect, [1], Workers(count=0))


def _defect(number: int) -> float:
    return number / 0


def test_no_scheduler_at_an_address_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexspline.fleet.cluster.ANSWER", 1)
    with pytest.raises(InputError, match=r"--scheduler tcp://127\.0\.0\.1:9: no Dask scheduler"):
        ran(str, [1], Workers("tcp://127.0.0.1:9"))


def test_without_dask_the_sentence_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'flexspline\[fleet\]'; or use --workers 0"):
        ran(str, [1], Workers(count=1))
    assert ran(str, [1, 2], Workers(count=0)) == ["1", "2"]


def test_workers_and_a_scheduler_together_are_refused() -> None:
    with pytest.raises(InputError, match="a scheduler has workers of its own"):
        Workers("tcp://x:1", 2)
    with pytest.raises(InputError, match="workers is -1"):
        Workers(count=-1)
