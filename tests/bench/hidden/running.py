"""Cases through worker processes; each outcome is a line of a file, so that a run can go on."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from tqdm import tqdm

import flexspline
from hidden.cases import Case
from hidden.trial import Outcome, tried

__all__ = ["outcomes_of"]


def outcomes_of(
    cases: Sequence[Case], path: Path, jobs: int, tell: Callable[[Outcome], None]
) -> list[Outcome]:
    """Return the outcomes of all cases, those that `path` holds already as they are there.

    Raises
    ------
    SystemExit
        Where the file comes from other code: its numbers would be mixed with those of this one.
    """
    done = {o.case.key: o for o in _read(path)}
    wanted = {case.key for case in cases}
    left = [case for case in cases if case.key not in done]
    shown = [o for key, o in done.items() if key in wanted]
    bar = tqdm(total=len(cases), initial=len(shown), desc="cases", smoothing=0.05)
    with path.open("a") as file, bar:
        for outcome in _worked(left, jobs):
            file.write(json.dumps(outcome.to_json()) + "\n")
            file.flush()
            shown.append(outcome)
            bar.update()
            if not outcome.right:
                tell(outcome)
    return sorted(shown, key=lambda o: o.case.number)


def _worked(cases: Sequence[Case], jobs: int) -> Iterator[Outcome]:
    if jobs == 1:
        yield from map(tried, cases)
        return
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap_unordered(tried, cases)


def _read(path: Path) -> list[Outcome]:
    """Return what a run left, whose last line may be cut; begin the file where there is none."""
    code = _code()
    if not path.exists():
        path.write_text(json.dumps({"code": code}) + "\n")
        return []
    lines = path.read_text().splitlines()
    if json.loads(lines[0])["code"] != code:
        raise SystemExit(f"{path} was made by other code; give another --out or delete it")
    kept = [line for line in lines if line.endswith("}")]
    path.write_text("\n".join(kept) + "\n")
    return [Outcome.from_json(json.loads(line)) for line in kept[1:]]


def _code() -> str:
    """A hash of the package and of this benchmark."""
    folders = (Path(flexspline.__file__).parent, Path(__file__).parent)
    files = [
        p for folder in folders for p in sorted(folder.rglob("*")) if p.suffix in (".py", ".so")
    ]
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
