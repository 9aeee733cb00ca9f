"""Are hidden effects named? Confusion matrix, false names and unknowns, with Wilson intervals.

    python tests/bench/hidden_effects.py --sizes 50 16 5 --seeds 2 --out hidden_effects.json

A size is the t that the true form reaches in the true noise once the base model and each rival
(every other candidate of the catalogue in its best form, one at a time) are taken out.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from hidden_effects_rigs import (
    BASES,
    FACTS,
    FORMS,
    LOAD,
    RATIO,
    RUNS,
    UNKNOWN,
    Array,
    Channels,
    Setting,
    base_torque,
    channels,
    noise,
    torsion,
)

from flexspline.discovery.analysis import analysed
from flexspline.discovery.assemble import assembled
from flexspline.discovery.dictionary import effect_rows
from flexspline.discovery.refit import started
from flexspline.discovery.result import Discovery
from flexspline.discovery.study import Study, study_of
from flexspline.discovery.table import tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working, working
from flexspline.effects import effect
from flexspline.logs.log import Log

ALIAS = 3.0
SETTINGS = (Setting(True, 0.6, 0.01), Setting(True, 0.9, 0.015), Setting(True, 0.0, 0.01),
            Setting(True, 0.97, 0.02))  # fmt: skip


@dataclass(frozen=True)
class Case:
    """What is hidden (nothing: empty), how large as t, seed and setting."""

    target: str
    hidden: tuple[str, ...]
    unknown: str
    size: float
    seed: int
    setting: Setting


@dataclass(frozen=True)
class Outcome:
    """One case: names given, right or not, and what the confidence was made of."""

    case: Case
    names: tuple[str, ...]
    aliases: tuple[tuple[str, ...], ...]
    confidences: tuple[float, ...]
    regressors: tuple[tuple[float, ...], ...]
    correct: tuple[bool, ...]
    right: bool
    unexplained: float | None
    closed: float
    seconds: float


def cases(
    target: str, sizes: Sequence[float], seeds: int, nothing: int, pairs: int
) -> Iterator[Case]:
    """Every effect alone, pairs, unknown causes, and nothing."""
    setting = cycle(SETTINGS)
    names = list(FORMS[target])
    for size in sizes:
        for seed in range(seeds):
            for name in names:
                yield Case(target, (name,), "", size, seed + 1, next(setting))
            for name in UNKNOWN:
                yield Case(target, (), name, size, seed + 1, next(setting))
        for k in range(pairs):
            pair = (names[k % len(names)], names[(5 * k + 3 + k // 4) % len(names)])
            if pair[0] != pair[1]:
                yield Case(target, pair, "", size, k + 1, next(setting))
    for k in range(nothing):
        yield Case(target, (), "", 0.0, 100 + k, next(setting))


def made(case: Case) -> tuple[list[Log], dict[str, list[Array]]]:
    """The runs of a case, and the hidden terms (N,) of each run by name, at their size."""
    every = [channels(case.seed, k, case.setting) for k in range(RUNS)]
    base = torsion if case.target == "torsion" else base_torque
    clean = [base(c) + noise(case.seed, k, case.setting, len(c["time"]))
             for k, c in enumerate(every)]  # fmt: skip
    forms = {name: [FORMS[case.target][name](c) for c in every] for name in case.hidden}
    if case.unknown:
        forms[case.unknown] = [UNKNOWN[case.unknown](c) for c in every]
    sized = {}
    for name, terms in forms.items():
        t = size_of(_logs(case.target, every, clean), terms, name, case)
        sized[name] = [case.size / t * term for term in terms]
    torque = [y + sum(s[k] for s in sized.values()) for k, y in enumerate(clean)]
    return _logs(case.target, every, torque), sized


def _logs(target: str, every: list[Channels], values: list[Array]) -> list[Log]:
    logs = []
    for k, (c, y) in enumerate(zip(every, values, strict=True)):
        columns = dict(c)
        if target == "sensor_torque":
            columns["sensor_torque"] = y + c[LOAD]
        elif target == "motor_torque":
            columns["motor_torque"] = (y + c[LOAD]) / RATIO
        else:
            columns["motor_position"] = RATIO * c["output_position"] - y
        logs.append(Log.from_arrays(facts={**FACTS, "name": f"run{k + 1}"}, **columns))
    return logs


def _studied(target: str, logs: list[Log]) -> tuple[Study, Working]:
    base = [effect(name) for name in BASES[target]]
    study = study_of(base, logs, target, known_load=LOAD, lowpass_hz=None, threads=1)
    return study, working(base, len(base), {})


def size_of(logs: list[Log], terms: list[Array], name: str, case: Case) -> float:
    """Least t over rivals of the true term in the true noise."""
    return _left(logs, terms, case, None, {name})


def _left(
    logs: list[Log], terms: list[Array], case: Case, only: list[str] | None, own: set[str]
) -> float:
    """Least t of a term beside base and one rival of those named (None: every other effect)."""
    study, work = _studied(case.target, logs)
    setting = case.setting
    true = Whitening(np.array([1.0, -setting.memory]), setting.size**2 * (1 - setting.memory**2), 1)
    work, _ = started(study.problem, work, true)
    rivals = [c for c in study.candidates(work.effects) if c.name not in own]
    if own & {"gravity", "output_ripple"}:  # order 1 of the output has two owners
        rivals = [c for c in rivals if c.name not in ("gravity", "output_ripple")]
    rivals = rivals if only is None else [c for c in rivals if c.name in only]
    wanted = [e for c in rivals for e in c.effects]
    columns = []
    for k, term in enumerate(terms):
        rows, target = work.rows(study.problem, k)
        beside = effect_rows(study.problem, work, wanted, k)
        columns.append((np.column_stack([rows, beside, term]), target))
    table = tabulated(study.problem, columns, true)
    model, last = np.arange(len(work.owners())), np.array([len(table.total) - 2])
    at, found = len(model), [_norm(table.without(model), last)]
    for e in wanted:
        end = at + len(e.terms)
        found.append(_norm(table.without(np.concatenate([model, np.arange(at, end)])), last))
        at = end
    return min(found)


def _norm(left: Array, column: Any) -> float:
    return float(np.sqrt(max(left[column[0], column[0]], 0.0)))


def tried(case: Case) -> Outcome:
    """Run one case through the discovery."""
    logs, terms = made(case)
    begun = time.perf_counter()
    study, work = _studied(case.target, logs)
    analysis = analysed(study, work.effects, {}, lambda _: None)
    found = assembled(analysis, (), None)  # type: ignore[arg-type]
    seconds = time.perf_counter() - begun
    judged = [_correct(one, case, logs, terms) for one in found.found]
    right = _right(found, case, judged)
    left = found.unexplained.share_of_variance if found.unexplained else None
    return Outcome(
        case,
        found.names,
        tuple(one.indistinguishable_from for one in found.found),
        tuple(one.confidence for one in found.found),
        tuple(one.regressors for one in found.found),
        tuple(judged),
        right,
        left,
        found.gap_closed,
        seconds,
    )


def _correct(one: Any, case: Case, logs: list[Log], terms: dict[str, list[Array]]) -> bool:
    """Whether a name is hidden there, or declares a hidden one as an alias that is real."""
    if one.effect in case.hidden:
        return True
    for name in one.indistinguishable_from:
        if name in case.hidden:
            return _left(logs, terms[name], case, [one.effect], {name}) < ALIAS
    return False


def _right(found: Discovery, case: Case, judged: list[bool]) -> bool:
    if case.unknown:
        return not found.found and (found.unexplained is not None or case.size <= 5.0)
    return all(judged) and len(judged) == len(case.hidden)


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share."""
    if not of:
        return 0.0, 1.0
    z, p = 1.96, hits / of
    middle = (p + z * z / (2 * of)) / (1 + z * z / of)
    half = z * np.sqrt(p * (1 - p) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return float(middle - half), float(middle + half)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--target", choices=list(FORMS), default="sensor_torque")
    parser.add_argument("--sizes", type=float, nargs="+", default=[50.0, 16.0, 5.0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--nothing", type=int, default=20)
    parser.add_argument("--pairs", type=int, default=0)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--out")
    given = parser.parse_args()
    outcomes = []
    for case in cases(given.target, given.sizes, given.seeds, given.nothing, given.pairs):
        if given.only and not {*case.hidden, case.unknown} & {*given.only}:
            continue
        one = tried(case)
        outcomes.append(one)
        what = "+".join(case.hidden) or case.unknown or "nothing"
        shown = ", ".join(f"{n} {c:.2f}{list(a) or ''}" for n, a, c in
                          zip(one.names, one.aliases, one.confidences, strict=True))  # fmt: skip
        left = "" if one.unexplained is None else f" unexplained {one.unexplained:.2f}"
        print(f"{'ok ' if one.right else 'BAD'} {what:32s} t {case.size:3.0f} "
              f"ar {case.setting.memory:.2f} {one.seconds:4.1f} s closed {one.closed:5.2f}: "
              f"{shown or '-'}{left}", flush=True)  # fmt: skip
    print(summary(outcomes))
    if given.out:
        Path(given.out).write_text(json.dumps([asdict(o) for o in outcomes], indent=1))


def summary(outcomes: Sequence[Outcome]) -> str:
    """Shares of right answers by kind and size, with intervals."""
    lines = []
    kinds = Counter((_kind(o.case), o.case.size) for o in outcomes)
    for (kind, size), count in sorted(kinds.items()):
        hits = sum(o.right for o in outcomes if (_kind(o.case), o.case.size) == (kind, size))
        low, high = wilson(hits, count)
        lines.append(f"{kind:8s} t {size:3.0f}: {hits:3d} of {count:3d} right "
                     f"({100 * low:.0f} to {100 * high:.0f} %)")  # fmt: skip
    seconds = [o.seconds for o in outcomes]
    lines.append(f"seconds: median {np.median(seconds):.1f}, worst {np.max(seconds):.1f}")
    return "\n".join(lines)


def _kind(case: Case) -> str:
    if case.unknown:
        return "unknown"
    return ("nothing", "single", "pair", "triple")[len(case.hidden)]


if __name__ == "__main__":
    main()
