"""Cases through worker processes; each outcome is a line of a file, so that a run can go on."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from tqdm import tqdm

import flexspline
from hidden.cases import Case

__all__ = ["outcomes_of"]


class Line(Protocol):
    """What becomes of a case."""

    @property
    def case(self) -> Case: ...

    def to_json(self) -> dict[str, Any]:
        """Return plain values, the key of the case among them."""
        ...


Made = TypeVar("Made", bound=Line)


def outcomes_of(
    cases: Sequence[Case],
    path: Path,
    jobs: int,
    work: Callable[[Case], Made],
    read: Callable[[dict[str, Any]], Made],
    tell: Callable[[Made], None],
) -> list[Made]:
    """Return the outcomes of all cases, those that `path` holds already as they are there.

    Parameters
    ----------
    work : makes an outcome of a case, in one of `jobs` processes.
    read : makes it of its line.
    tell : what to do with each new one.

    Raises
    ------
    SystemExit
        Where the file comes from other code: its numbers would be mixed with those of this one.
    """
    done = {line["key"]: read(line) for line in _lines(path)}
    left = [case for case in cases if case.key not in done]
    shown = [done[case.key] for case in cases if case.key in done]
    bar = tqdm(total=len(cases), initial=len(shown), desc="cases", smoothing=0.05)
    with path.open("a") as file, bar:
        for outcome in _worked(left, jobs, work):
            file.write(json.dumps(outcome.to_json()) + "\n")
            file.flush()
            shown.append(outcome)
            bar.update()
            tell(outcome)
    return sorted(shown, key=lambda o: o.case.number)


def _worked(cases: Sequence[Case], jobs: int, work: Callable[[Case], Made]) -> Iterator[Made]:
    if jobs == 1:
        yield from map(work, cases)
        return
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap_unordered(work, cases)


def _lines(path: Path) -> list[dict[str, Any]]:
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
    return [json.loads(line) for line in kept[1:]]


def _code() -> str:
    """A hash of the package and of this benchmark."""
    here = Path(__file__).parent
    files = [p for folder in (Path(flexspline.__file__).parent, here)
             for p in sorted(folder.rglob("*")) if p.suffix in (".py", ".so")]  # fmt: skip
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
