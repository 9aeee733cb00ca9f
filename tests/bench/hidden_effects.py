"""Are hidden effects named? Confusion matrix, false names, unknowns, reliability, gap closed.

    python tests/bench/hidden_effects.py --out DIR [--quick] [--jobs 2] [--target T] [--only NAME…]
                                         [--class exact|lab|robot] [--fresh NUMBER [--limit N]]
    python tests/bench/hidden_effects.py --class lab --case NUMBER [--fresh NUMBER] --write DIR

About a thousand frozen cases (see hidden/): each effect alone, pairs, triples, causes without a
name, effects taken out of the candidates, forms that are off, and 300 logs that hide nothing.
Another deal of the same kinds, to work on, is had by --fresh; the frozen cases are to judge by.
A size is the t that the true form reaches in the true noise once base and rivals are taken out.
The classes lab and robot have a recorder between joint and log (hidden/recorder.py), and 1400 and
1150 cases of their own. --write puts the runs of one case into DIR, for the command line.
DIR receives cases.jsonl (a line for each case; a run that was stopped goes on from there),
hidden_effects.json, hidden_effects.txt and hidden_effects.png. Printed on the way: what is wrong.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hidden.cases import CLASSES, Case, cases, quick, recorded_cases
from hidden.forms import FORMS
from hidden.running import outcomes_of
from hidden.tables import summary, text
from hidden.trial import Outcome, tried
from hidden.writing import written
from tqdm import tqdm


def main() -> None:
    given = _arguments()
    chosen = _chosen(given)
    if given.write is not None:
        for case in chosen:
            written(case, given.write)
        return
    given.out.mkdir(parents=True, exist_ok=True)
    lines = given.out / "cases.jsonl"
    outcomes = outcomes_of(chosen, lines, given.jobs, tried, Outcome.from_json, _tell)
    if not outcomes:
        raise SystemExit("no case fits --target and --only")
    from hidden.figure import drawn

    said = text(outcomes)
    (given.out / "hidden_effects.txt").write_text(said + "\n")
    (given.out / "hidden_effects.json").write_text(json.dumps(summary(outcomes), indent=1))
    drawn([o for o in outcomes if not o.undealt], given.out / "hidden_effects.png")
    print(said)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for results")
    parser.add_argument("--class", dest="recorder", choices=CLASSES, default="exact")
    parser.add_argument("--case", type=int, help="this one alone, by its number")
    parser.add_argument("--write", type=Path, help="folder for the runs of --case")
    parser.add_argument("--quick", action="store_true", help="some sixty cases, evenly chosen")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--target", choices=list(FORMS))
    parser.add_argument("--only", nargs="+", help="cases that hide one of these, or of these kinds")
    parser.add_argument("--fresh", type=int, default=0, help="another deal of cases, by its number")
    parser.add_argument("--limit", type=int, help="the first so many")
    given = parser.parse_args()
    if (given.out is None) == (given.write is None) or (given.write and given.case is None):
        parser.error("give --out DIR, or --case NUMBER --write DIR")
    return given


def _chosen(given: argparse.Namespace) -> list[Case]:
    every = cases(given.fresh) if given.recorder == "exact" else (
        recorded_cases(given.recorder, given.fresh))  # fmt: skip
    every = quick(every) if given.quick else every
    every = [c for c in every if given.case in (None, c.number)]
    every = [c for c in every if given.target in (None, c.target)]
    only = {*(given.only or ())}
    every = [c for c in every if not only or only & {*c.hidden, c.unknown, c.kind}]
    return every[: given.limit]


def _tell(one: Outcome) -> None:
    """Say what is wrong with a case, above the progress bar."""
    if one.right:
        return
    if one.undealt:
        tqdm.write(f"{one.case.key}: not dealt, largest t {one.undealt}")
        return
    shown = ", ".join(
        f"{name} {confidence:.2f}{list(aliases) or ''}"
        for name, aliases, confidence in zip(one.names, one.aliases, one.confidences, strict=True)
    )
    left = "" if one.unexplained is None else f"; unexplained {one.unexplained:.2f}"
    where = f"{one.case.joint}, {one.case.excitation}, {one.case.noise}"
    faults = f"; faults: {', '.join(sorted({*one.faults}))}" if one.faults else ""
    tqdm.write(f"{one.case.key} ({where}): {one.error or shown or '-'}{left}{faults}")


if __name__ == "__main__":
    main()
