"""Work on every run or joint of a fleet, on Dask: on this machine, or wherever a scheduler is.

A task is one run (or one joint). What it returns is taken off the workers at once, so that a worker
that dies costs what it was working on, which Dask gives to another, and nothing else. Results come
back in the order of the tasks, whoever made them when: one worker, two, and none at all give the
same bits.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from flexspline.errors import InputError, one_line
from flexspline.progress import Progress

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["Failed", "Workers", "done", "require_some", "split_failed", "staying"]

Task = TypeVar("Task")
Made = TypeVar("Made")

NEEDS = "a fleet is worked on by Dask, which is not installed: pip install 'flexspline[fleet]'"
WITHOUT = "; or use --workers 0, this process alone"


@dataclass(frozen=True)
class Workers:
    """Who works.

    Parameters
    ----------
    scheduler : address of a Dask scheduler, such as "tcp://10.0.0.5:8786", or a client of one; its
        workers need flexspline, and the runs under the same paths. None: a cluster of processes on
        this machine.
    count : of these processes; None: one for each processor. 0: this process alone, without Dask.
        In a script, processes need `if __name__ == "__main__":` around the call.
    rounds : what several rounds of work share, see `staying`.
    """

    scheduler: str | Client | None = None
    count: int | None = None
    rounds: _Rounds | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.count is not None and not 0 <= self.count <= 1024:
            raise InputError(f"workers is {self.count}; give 0 to 1024")
        if self.scheduler is not None and self.count is not None:
            raise InputError("a scheduler has workers of its own; leave the number of workers out")


@dataclass
class _Rounds:
    """What several rounds of work share: the client, once the first of them has asked for it."""

    stack: ExitStack
    client: Client | None = None


@contextmanager
def staying(workers: Workers) -> Iterator[Workers]:
    """Yield these workers for several rounds of work: a cluster is started once, when needed."""
    with ExitStack() as stack:
        yield replace(workers, rounds=_Rounds(stack))


@dataclass(frozen=True)
class Failed:
    """Why a task has no result: one sentence."""

    why: str


@dataclass(frozen=True)
class _Guarded(Generic[Task, Made]):
    """A task whose wrong input is a result as well."""

    work: Callable[[Task], Made]

    def __call__(self, task: Task) -> Made | Failed:
        try:
            return self.work(task)
        except InputError as error:
            return Failed(str(error))
        except MemoryError:
            return Failed("does not fit into the memory of a worker; record shorter runs")


def done(
    work: Callable[[Task], Made],
    tasks: Sequence[Task],
    workers: Workers,
    progress: Progress,
) -> list[Made | Failed]:
    """Return work(task) of each task, in order; `Failed` where its input is wrong.

    Raises
    ------
    InputError
        Where Dask is asked for and not there, or no scheduler answers.
    """
    guarded = _Guarded[Task, Made](work)
    if workers.scheduler is None and workers.count == 0:
        made = []
        for task in tasks:
            made.append(guarded(task))
            progress.step()
        return made
    with ExitStack() as stack:
        rounds = workers.rounds or _Rounds(stack)
        if rounds.client is None:
            rounds.client = rounds.stack.enter_context(_client(workers, len(tasks)))
        return _gathered(rounds.client, guarded, tasks, progress)


def split_failed(
    names: Sequence[str], made: Sequence[Made | Failed]
) -> tuple[list[Made], list[tuple[str, str]]]:
    """Return what `done` has made, and (name, why) of the tasks that failed."""
    failed = [
        (name, each.why) for name, each in zip(names, made, strict=True) if isinstance(each, Failed)
    ]
    return [each for each in made if not isinstance(each, Failed)], failed


def require_some(made: Sequence[object], failed: Sequence[tuple[str, str]], other: str) -> None:
    """Refuse a fleet of which nothing is left, with the first reason; `other` ends the sentence."""
    if not made:
        raise InputError(f"{failed[0][0]}: {failed[0][1]} (and {other})")


def _gathered(
    client: Client, work: Callable[[Task], Made | Failed], tasks: Sequence[Task], progress: Progress
) -> list[Made | Failed]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    futures = client.map(work, tasks, pure=False)
    places = {future.key: k for k, future in enumerate(futures)}
    made: list[Made | Failed | None] = [None] * len(tasks)
    for future in as_completed(futures):
        place = places[future.key]
        try:
            made[place] = future.result()
        except KilledWorker:
            made[place] = Failed(
                "its worker died each time that it was tried, as one does that runs out of memory; "
                "give workers more memory, or record shorter runs"
            )
        future.release()
        progress.step()
    return [each for each in made if each is not None]


@contextmanager
def _client(workers: Workers, tasks: int) -> Iterator[Client]:
    try:
        from distributed import Client, LocalCluster
    except ModuleNotFoundError as error:
        raise InputError(NEEDS + (WITHOUT if workers.scheduler is None else "")) from error
    if isinstance(workers.scheduler, Client):
        yield workers.scheduler
        return
    if workers.scheduler is not None:
        try:
            client = Client(workers.scheduler, timeout=ANSWER)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(
                f"--scheduler {workers.scheduler}: no Dask scheduler answers there "
                f"({one_line(str(error))}); give an address such as tcp://10.0.0.5:8786"
            ) from error
        with client:
            yield client
        return
    count = min(workers.count or os.cpu_count() or 1, max(tasks, 1))
    with (
        LocalCluster(n_workers=count, threads_per_worker=1, **_QUIET) as cluster,
        Client(cluster) as client,
    ):
        yield client


ANSWER = 10  # s
_QUIET: dict[str, Any] = {"processes": True, "dashboard_address": ":0", "silence_logs": 50}
