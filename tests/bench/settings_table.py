"""What halving and doubling each number of `discover` does to its names.

    python tests/bench/settings_table.py --class exact|lab|robot --out DIR [--fresh 57]
                                         [--limit 200] [--only FIELD…] [--jobs 2]

Each field of `flexspline.discovery.settings.Settings` is halved and doubled, alone; a share above
one half is taken half and twice as far from one. Each variant goes through the same drawn cases
(never the frozen ones). Printed: right sets of names, cases with a wrong name or fault, processor
time, and by how many cases a variant is better and worse than today's numbers. DIR receives a
folder for each variant (a run that was stopped goes on from there) and settings_table.txt.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hidden.altered import ONE, TODAY  # isort: skip
from hidden.cases import CLASSES, cases, recorded_cases
from hidden.running import outcomes_of
from hidden.trial import Outcome, tried

from flexspline.discovery.settings import SETTINGS, Settings


def variants() -> Iterator[tuple[str, str, float]]:
    """Field, label and value of each variant."""
    for field in fields(Settings):
        value = getattr(SETTINGS, field.name)
        whole = isinstance(value, int)
        for label, factor in (("half", 0.5), ("double", 2.0)):
            if 0.5 < value < 1.0:
                yield field.name, label, 1.0 - (1.0 - value) / factor
            else:
                yield field.name, label, max(1, round(value * factor)) if whole else value * factor


def main() -> None:
    given = _arguments()
    if given.one:
        _read(given, given.out)
        return
    given.out.mkdir(parents=True, exist_ok=True)
    chosen = [v for v in variants() if not given.only or v[0] in given.only]
    jobs = [(TODAY, "", 0.0), *chosen]
    with ThreadPoolExecutor(given.jobs) as pool:
        made = list(pool.map(lambda job: _outcomes(given, *job), jobs))
    lines = [f"{'field':14s} {'value':>10s}  right  wrong  better  worse  s/case"]
    lines += [_line(job, own, made[0]) for job, own in zip(jobs, made, strict=True)]
    (given.out / "settings_table.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def _line(job: tuple[str, str, float], own: list[Outcome], today: list[Outcome]) -> str:
    name, _, value = job
    dealt = [(o, t) for o, t in zip(own, today, strict=True) if not o.undealt]
    right, wrong = (sum(bool(getattr(o, what)) for o, _ in dealt) for what in ("right", "wrong"))
    better = sum(o.right and not t.right for o, t in dealt)
    worse = sum(t.right and not o.right for o, t in dealt)
    seconds = sum(o.seconds for o, _ in dealt) / max(len(dealt), 1)
    shown = "" if name == TODAY else f"{value:g}"
    return (f"{name:14s} {shown:>10s}  {right:5d}  {wrong:5d}  {better:6d}  {worse:5d}  "
            f"{seconds:6.2f}")  # fmt: skip


def _outcomes(given: argparse.Namespace, name: str, label: str, value: float) -> list[Outcome]:
    """The outcomes of one variant, from a process of its own."""
    folder = given.out / f"{name}{label and '-'}{label}"
    call = {"--class": given.recorder, "--out": folder, "--fresh": given.fresh,
            "--limit": given.limit, ONE: f"{name}={value!r}"}  # fmt: skip
    words = [str(word) for pair in call.items() for word in pair]
    subprocess.run([sys.executable, __file__, *words], check=True)
    return _read(given, folder)


def _read(given: argparse.Namespace, folder: Path) -> list[Outcome]:
    """The outcomes in a folder; those that are not there yet are made."""
    folder.mkdir(parents=True, exist_ok=True)
    every = cases(given.fresh) if given.recorder == "exact" else (
        recorded_cases(given.recorder, given.fresh))  # fmt: skip
    lines = folder / "cases.jsonl"
    chosen = every[: given.limit]
    return outcomes_of(chosen, lines, 1, tried, Outcome.from_json, lambda _: None)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument("--class", dest="recorder", choices=CLASSES, default="robot")
    parser.add_argument("--fresh", type=int, default=57, help="a deal of cases, by its number")
    parser.add_argument("--limit", type=int, default=200, help="the first so many")
    parser.add_argument("--only", nargs="+", help="these fields")
    parser.add_argument("--jobs", type=int, default=2, help="variants at a time")
    parser.add_argument(ONE, help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    main()
