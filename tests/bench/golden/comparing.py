"""Numbers of now against those of a file: how many have the same bits, and what differs.

A number may differ by `TOLERANCE` of the larger of the two; below `TINY` the difference itself is
taken. Names, hashes and what is there may not. A cost may fall.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from golden.numbers import COST, Numbers, Value

__all__ = ["SHOWN", "TOLERANCE", "Compared", "compared", "table"]

TOLERANCE = 1e-12
TINY = 1e-300
SHOWN = 12  # differences of a case that are listed


@dataclass(frozen=True)
class Compared:
    """One case: how many values there are and are the same, and the largest relative difference.

    `wrong`: what may not differ so, in words. `lower`: costs that have fallen.
    """

    name: str
    count: int
    same: int
    largest: float
    wrong: tuple[str, ...]
    lower: tuple[str, ...]


def compared(name: str, old: Mapping[str, Value], new: Mapping[str, Value]) -> Compared:
    """Compare the values of a case."""
    same, largest = 0, 0.0
    wrong = [f"gone: {key}" for key in old if key not in new]
    wrong += [f"new: {key}" for key in new if key not in old]
    lower = []
    for key in old.keys() & new.keys():
        before, after = old[key], new[key]
        if repr(before) == repr(after):
            same += 1
        elif key.startswith(COST) and _falls(before, after):
            lower.append(f"{key.removeprefix(COST)}: {before} → {after}")
        else:
            off = difference(before, after)
            largest = max(largest, off)
            if off > TOLERANCE or key.startswith(COST):
                wrong.append(f"{key}: {before} → {after}")
    return Compared(name, len(old), same, largest, tuple(sorted(wrong)), tuple(sorted(lower)))


def _falls(before: Value, after: Value) -> bool:
    numbers = not isinstance(before, str) and not isinstance(after, str)
    return numbers and float(after) < float(before)


def difference(before: Value, after: Value) -> float:
    """Return the difference over the larger of the two; 1 of strings that differ."""
    if isinstance(before, str) or isinstance(after, str):
        return 1.0
    larger = max(abs(before), abs(after))
    return abs(after - before) / (larger if larger > TINY else 1.0)


def table(cases: list[Compared]) -> Iterator[str]:
    """Yield a line for each case, and what differs below it."""
    width = max(len(case.name) for case in cases)
    yield f"{'':<{width}}{'values':>8}{'same bits':>11}{'largest of the rest':>21}"
    for case in cases:
        rest = f"{case.largest:.1e}" if case.largest else "-"
        bad = f"  {len(case.wrong)} DIFFER" if case.wrong else ""
        yield f"{case.name:<{width}}{case.count:>8}{case.same:>11}{rest:>21}{bad}"
        yield from (f"    {said}" for said in case.wrong[:SHOWN])
        if len(case.wrong) > SHOWN:
            yield f"    and {len(case.wrong) - SHOWN} more"
        yield from (f"    less, and that is well: {said}" for said in case.lower)


def merged(old: Mapping[str, Numbers], new: Mapping[str, Numbers]) -> dict[str, Numbers]:
    """Return both, sorted; of a case that both have, the new one."""
    every = {**old, **new}
    return {name: dict(sorted(every[name].items())) for name in sorted(every)}
