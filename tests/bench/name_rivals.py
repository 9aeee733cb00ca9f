"""Do methods of others name hidden effects? The same cases and dictionary as hidden_effects.py.

    pip install "flexspline[bench]"
    python tests/bench/name_rivals.py --out DIR [--quick] [--jobs 2] [--target T] [--only KIND…]

LassoCV (also by the rule of one standard error) and orthogonal matching pursuit of scikit-learn,
stepwise BIC, and PySINDy's STLSQ, SSR and FROLS, their size chosen by validation over runs,
beside `discover` in the same run. A method names the effects whose columns it selects. They are
favoured: what discover has to declare as an alias counts for them undeclared, and "unexplained",
which none of them can say, is not asked for.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from hidden.cases import Case, cases, quick
from hidden.dictionary import columns_of
from hidden.forms import FORMS
from hidden.made import Made, made_of
from hidden.rivals import forms_of
from hidden.running import outcomes_of
from hidden.selectors import METHODS
from hidden.shares import Share, share
from hidden.trial import outcome_of, plain_case, stands_for, timed

DISCOVER = "discover"
CLASSES = {
    "nothing": ("nothing",),
    "one": ("single",),
    "two": ("pair",),
    "three": ("triple",),
    "unknown": ("unknown", "removed"),
    "form off": ("mismatch",),
}


@dataclass(frozen=True)
class Answers:
    """By method: the names given, whether they are the right ones, and seconds."""

    case: Case
    names: dict[str, tuple[str, ...]]
    right: dict[str, bool]
    seconds: dict[str, float]

    def to_json(self) -> dict[str, Any]:
        return {"key": self.case.key, **asdict(self)}

    @classmethod
    def from_json(cls, line: dict[str, Any]) -> Answers:
        return cls(plain_case(line["case"]), line["names"], line["right"], line["seconds"])


def answered(case: Case) -> Answers:
    """Ask every method."""
    made = made_of(case)
    found, seconds = timed(case, made)
    own = outcome_of(case, made, found, seconds)
    right = own.right if case.nameable or case.kind == "nothing" else not own.names
    answers = Answers(case, {DISCOVER: own.names}, {DISCOVER: right}, {DISCOVER: seconds})
    begun = time.perf_counter()
    columns = columns_of(made, case.target, case.excluded)
    dictionary = time.perf_counter() - begun
    for method, chosen in METHODS.items():
        begun = time.perf_counter()
        names = columns.of(chosen(columns))
        answers.seconds[method] = dictionary + time.perf_counter() - begun
        answers.names[method] = names
        answers.right[method] = _right(case, made, names)
    return answers


def _right(case: Case, made: Made, names: tuple[str, ...]) -> bool:
    """Whether the names are those hidden; any alias that is real counts."""
    if len(names) != len(case.nameable):
        return False
    forms = [forms_of(name, made.scenes[0].joint)[0] for name in names]
    means = stands_for(case, made, forms, [case.nameable] * len(names))
    return set(means) == set(case.nameable)


def table(every: Sequence[Answers]) -> dict[str, dict[str, Share]]:
    """Shares of right sets by class and method."""
    kinds: dict[str, list[Answers]] = {}
    for name, own in CLASSES.items():
        here = [a for a in every if a.case.kind in own]
        for size in sorted({a.case.size for a in here}, reverse=True):
            if name in ("nothing", "form off"):
                kinds[name] = here
            else:
                kinds[f"{name}, t = {size:g}"] = [a for a in here if a.case.size == size]
    kinds["all"] = list(every)
    return {label: {m: share(m, (a.right[m] for a in own)) for m in (DISCOVER, *METHODS)}
            for label, own in kinds.items()}  # fmt: skip


def text(every: Sequence[Answers]) -> str:
    """Return the table: share of right sets in per cent, Wilson's 95 % interval, seconds."""
    methods = (DISCOVER, *METHODS)
    lines = [" " * 24 + "".join(f"{m:>18s}" for m in methods)]
    for label, row in table(every).items():
        cells = [
            f"{100 * s.value:.0f} ({100 * s.low:.0f}–{100 * s.high:.0f})" for s in row.values()
        ]
        lines.append(f"{label:17s}{row[DISCOVER].of:5d}  " + "".join(f"{c:>18s}" for c in cells))
    for what, of in (("seconds, median", np.median), ("seconds, worst", np.max)):
        cells = [f"{of([a.seconds[m] for a in every]):.1f}" for m in methods]
        lines.append(f"{what:24s}" + "".join(f"{c:>18s}" for c in cells))
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument("--quick", action="store_true", help="some seventy cases")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--target", choices=list(FORMS))
    parser.add_argument("--only", nargs="+", help="kinds of cases, such as single or nothing")
    given = parser.parse_args()
    chosen = [c for c in (quick(cases()) if given.quick else cases())
              if given.target in (None, c.target) and c.kind in (given.only or (c.kind,))
              and c.kind != "restless"]  # fmt: skip
    given.out.mkdir(parents=True, exist_ok=True)
    lines = given.out / "rivals.jsonl"
    every = outcomes_of(chosen, lines, given.jobs, answered, Answers.from_json, lambda _: None)
    if not every:
        raise SystemExit("no case fits --target and --only")
    said = text(every)
    shares = {label: {m: asdict(s) for m, s in row.items()} for label, row in table(every).items()}
    (given.out / "name_rivals.txt").write_text(said + "\n")
    (given.out / "name_rivals.json").write_text(json.dumps(shares, indent=1))
    print(said)


if __name__ == "__main__":
    main()
