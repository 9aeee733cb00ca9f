"""Fit the confidence of a name to how often names were right, and check it on other cases.

    python tests/bench/calibrate_confidence.py first/cases.jsonl second/cases.jsonl
                                               [--check other/cases.jsonl]

Each file holds outcomes of the hidden-effect benchmark: for each case the regressors of its names
(`discovery/confidence.py`) and what each stands for, "" if it is wrong. Prints the coefficients of
a logistic model, drawn weakly towards those of 280 names that earlier searches gave, to be written
into that file; and the reliability: in bins of the probability stated, the share that was right.
Without --check the reliability is that of cases left out five by five of the same files.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from flexspline.discovery.confidence import FEATURES

Array = NDArray[np.float64]

PRIOR = 0.05  # of each coefficient's square, in units of one name's log-likelihood
BEFORE = np.array([-0.716, 0.220, 0.0, 3.117, -5.514, -0.703])  # what the prior draws towards
SIGNS = ((None, None), (0.0, None), (0.0, None), (0.0, None), (None, 0.0), (None, 0.0))
"""More evidence, lead and survival never make a name less likely, nor aliases more."""
BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 1.0)


def read(paths: Sequence[str]) -> tuple[Array, Array]:
    """Regressors (n, K) of all names, and whether each was right, (n,)."""
    rows, right = [], []
    for outcome in (one for path in paths for one in _outcomes(Path(path))):
        for regressors, means in zip(outcome["regressors"], outcome["means"], strict=True):
            rows.append(regressors)
            right.append(means != "")
    return np.array(rows, dtype=float).reshape(-1, len(FEATURES)), np.array(right, dtype=float)


def _outcomes(path: Path) -> list[dict[str, Any]]:
    lines = map(json.loads, path.read_text().splitlines())
    return [line for line in lines if "regressors" in line]  # the first says which code made them


def fitted(rows: Array, right: Array) -> Array:
    """Coefficients (K,) of the logistic model, with signs that make sense; none of the constant."""
    prior = np.full(rows.shape[1], PRIOR)
    prior[0] = 0.0

    def loss(b: Array) -> float:
        score = rows @ b
        return float(np.sum(np.logaddexp(0.0, score) - right * score) + prior @ (b - BEFORE) ** 2)

    return np.asarray(minimize(loss, BEFORE, bounds=SIGNS).x)


def left_out(rows: Array, right: Array, folds: int = 5) -> Array:
    """Probabilities (n,) of names that the coefficients never saw."""
    made = np.empty(len(right))
    for fold in range(folds):
        mine = np.arange(len(right)) % folds == fold
        made[mine] = expit(rows[mine] @ fitted(rows[~mine], right[~mine]))
    return made


def reliability(stated: Array, right: Array) -> str:
    """One line for each bin: names, mean probability stated, share right; and the Brier score."""
    lines = []
    for low, high in pairwise(BINS):
        inside = (stated >= low) & ((stated < high) | (high == BINS[-1]))
        if inside.any():
            said, share = stated[inside].mean(), right[inside].mean()
            lines.append(f"{low:.2f} to {high:.2f}: {inside.sum():4d} names, "
                         f"stated {said:.3f}, right {share:.3f}")  # fmt: skip
    lines.append(f"Brier score {np.mean((stated - right) ** 2):.4f}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("files", nargs="+")
    parser.add_argument("--check", nargs="+")
    given = parser.parse_args()
    rows, right = read(given.files)
    coefficients = fitted(rows, right)
    print(f"{len(right)} names, {int(right.sum())} right")
    for name, value in zip(FEATURES, coefficients, strict=True):
        print(f"  {name:12s} {value:8.3f}")
    if given.check:
        rows, right = read(given.check)
        print(reliability(expit(rows @ coefficients), right))
    else:
        print(reliability(left_out(rows, right), right))


if __name__ == "__main__":
    main()
