"""The runs of a case as files, to be tried with the command line."""

from __future__ import annotations

from pathlib import Path

from flexspline.logs import write_log
from hidden.cases import Case
from hidden.made import made_of
from hidden.recorded import recorded
from hidden.rig import LOAD

__all__ = ["written"]


def written(case: Case, folder: Path) -> None:
    """Write the runs of a case that are fitted, and print what is hidden and the call."""
    made = made_of(case) if case.recorder == "exact" else recorded(case)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{log.name}.csv" for log in made.logs]
    for log, path in zip(made.logs, paths, strict=True):
        write_log(log, path)
    load = f" --known-load {LOAD}" if LOAD in made.logs[0] else ""
    excluded = f" --exclude {','.join(case.excluded)}" if case.excluded else ""
    print(f"{case.key}: {made.recorder or 'exact'}")
    print(f"flexspline discover {' '.join(map(str, paths))} --target {case.target}{load}{excluded} "
          f"--effects {','.join(e.name for e in made.base)} --out {folder / 'found'}")  # fmt: skip
