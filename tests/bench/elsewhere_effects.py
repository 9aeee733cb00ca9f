"""Are hidden effects named in joints from another hand? Right answers by what is hidden.

    python tests/bench/elsewhere_effects.py --from 0 --to 80 [--out DIR]

A seed is a case of `elsewhere/`: an even one of a laboratory's rig, an odd one of a robot's joint.
Printed is a line for each case, and at the end the table. DIR receives elsewhere_cases.jsonl (a
line for each case) and elsewhere_effects.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from elsewhere.joint import UNKNOWN
from elsewhere.recorder import recorded

import flexspline
from flexspline import Discovery

MOST_ALIASES = 3  # names of a declared list that counts
KINDS = ("lab", "robot")
CLASSES = ("nothing", "unknown cause", "one effect", "two effects")


@dataclass(frozen=True)
class Outcome:
    """A case and what came of it.

    `wrong`: names that stand for nothing hidden. `unexplained`: share of the variance, or None.
    `rmse`: of the base, of all found, and the noise floor, in the unit of the target, as is the
    true `noise`. `seconds`: of processor time. `error`: what `discover` raised.
    """

    seed: int
    kind: str
    target: str
    description: str
    base: tuple[str, ...]
    hidden: tuple[str, ...]
    noise: float
    seconds: float
    names: tuple[str, ...] = ()
    aliases: tuple[tuple[str, ...], ...] = ()
    confidences: tuple[float, ...] = ()
    wrong: tuple[str, ...] = ()
    right: bool = False
    unexplained: float | None = None
    rmse: tuple[float, ...] = ()
    faults: tuple[str, ...] = ()
    error: str = ""

    @property
    def what(self) -> str:
        """One of CLASSES."""
        if self.hidden and self.hidden[0].startswith(UNKNOWN):
            return CLASSES[1]
        return (CLASSES[0], *CLASSES[2:])[len(self.hidden)]


def judged(
    names: Sequence[str],
    aliases: Sequence[Sequence[str]],
    hidden: Sequence[str],
    unexplained: bool,
) -> tuple[tuple[str, ...], bool]:
    """Return the names that stand for nothing hidden, and whether all is as it should be.

    Each hidden effect is named once, itself or by a name that declares it among at most
    MOST_ALIASES aliases, and nothing else is named. A cause without a name: nothing is named, and
    something is said to be unexplained.
    """
    nameable = [name for name in hidden if not name.startswith(UNKNOWN)]
    left = [name for name in nameable if name not in names]
    wrong = []
    for name, own in zip(names, aliases, strict=True):
        meant = [h for h in left if h in own and len(own) <= MOST_ALIASES]
        if name in nameable:
            continue
        if meant:
            left.remove(meant[0])
        else:
            wrong.append(name)
    return tuple(wrong), not (wrong or left) and (unexplained or len(nameable) == len(hidden))


def tried(seed: int) -> Outcome:
    """Run one case through `discover`."""
    made = recorded(seed)
    case = (seed, made.kind, made.target, made.description, tuple(map(str, made.base)),
            made.hidden, made.noise)  # fmt: skip
    begun = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = flexspline.discover(
                made.base, made.logs, target=made.target, known_load=made.known_load
            )
    except Exception as failure:
        error = f"{type(failure).__name__}: {failure}"
        return Outcome(*case, time.process_time() - begun, error=error)
    return _judged(Outcome(*case, time.process_time() - begun), found)


def _judged(one: Outcome, found: Discovery) -> Outcome:
    names = tuple(each.effect for each in found.found)
    aliases = tuple(tuple(map(str, each.indistinguishable_from)) for each in found.found)
    left = found.unexplained
    wrong, right = judged(names, aliases, one.hidden, left is not None)
    return replace(
        one, names=names, aliases=aliases, wrong=wrong, right=right,
        confidences=tuple(each.confidence for each in found.found),
        unexplained=None if left is None else left.share_of_variance,
        rmse=(found.base_rmse, found.final_rmse, found.noise_floor),
        faults=tuple(f"{fault.name} of {fault.channel}" for fault in found.data_faults),
    )  # fmt: skip


def line(one: Outcome) -> str:
    """Return what came of a case."""
    shown = ", ".join(
        f"{name} {confidence:.2f}{list(aliases) or ''}"
        for name, aliases, confidence in zip(one.names, one.aliases, one.confidences, strict=True)
    )
    left = "" if one.unexplained is None else f"; unexplained {one.unexplained:.2f}"
    hidden, verdict = ", ".join(one.hidden) or "nothing", "right" if one.right else "WRONG"
    return (f"{one.seed:4d} {one.kind:5s} {one.target:13s} {verdict}: {hidden} -> "
            f"{one.error or shown or '-'}{left}; {one.seconds:.1f} s")  # fmt: skip


def table(every: Sequence[Outcome]) -> str:
    """Return right answers by kind and by what is hidden, wrong names, and processor time."""
    lines = [f"{'Right answers':16s}" + "".join(f"{kind:>14s}" for kind in (*KINDS, "both"))]
    for what in (*CLASSES, "all"):
        own = [one for one in every if what in (one.what, "all")]
        cells = []
        for kinds in (*((kind,) for kind in KINDS), KINDS):
            here = [one.right for one in own if one.kind in kinds]
            cells.append(f"{f'{sum(here)} of {len(here)}':>14s}")
        lines.append(f"{what:16s}" + "".join(cells))
    wrong = [one for one in every if one.wrong]
    times = [one.seconds for one in every]
    errors = sum(bool(one.error) for one in every)
    return "\n".join([*lines, f"Cases with a wrong name: {len(wrong)} of {len(every)}; "
                      f"that ended in an error: {errors}",
                      f"Processor time of a case: median {np.median(times):.1f} s, "
                      f"worst {np.max(times):.1f} s"])  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--from", dest="first", type=int, default=0, help="first seed")
    parser.add_argument("--to", dest="end", type=int, default=80, help="seed after the last")
    parser.add_argument("--out", type=Path, help="folder for results")
    given = parser.parse_args()
    if not 0 <= given.first < given.end:
        parser.error("give --from and --to with 0 <= from < to")
    every = []
    for seed in range(given.first, given.end):
        every.append(tried(seed))
        print(line(every[-1]), flush=True)
        if given.out is not None:
            _kept(every[-1], given.out / "elsewhere_cases.jsonl", begin=len(every) == 1)
    said = table(every)
    print("\n" + said)
    if given.out is not None:
        (given.out / "elsewhere_effects.txt").write_text(said + "\n")


def _kept(one: Outcome, path: Path, *, begin: bool) -> None:
    """Write a line of the file, which the first one begins anew."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w" if begin else "a") as file:
        file.write(json.dumps(asdict(one)) + "\n")


if __name__ == "__main__":
    main()
