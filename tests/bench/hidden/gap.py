"""How much of the gap is closed on runs that nobody fitted, against what the true forms close.

Squares without noise: E = Σ (truth − prediction)². The base and the base with the true terms are
fitted by generalised least squares in the true noise; what `discover` made predicts by itself.

    closed = (E_base − E_found) / (E_base − E_true)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.checks.ends import DRIVES, resting
from flexspline.logs.log import Log
from flexspline.model import Model
from hidden.made import Made
from hidden.rig import Array
from hidden.size import base_rows

__all__ = ["closed"]


def closed(made: Made, model: Model) -> float | None:
    """Share of what the true forms close on the runs held out; None where they close nothing."""
    first = len(made.logs)
    counts = np.concatenate([_counts(model.part().target, log) for log in made.held_out])
    truth = np.concatenate(made.clean[first:])
    known = [base_rows_of(made, k) for k in range(len(made.scenes))]
    true = [np.column_stack([rows, *(term[k] for term in made.terms.values())])
            for k, rows in enumerate(known)]  # fmt: skip
    ratio = {name: model.facts[name] for name in ("gear_ratio",) if name in model.facts}
    logs = [log.with_facts(ratio) for log in made.held_out]  # where it was found to be another
    found = np.concatenate([model.predict(log).predicted for log in logs])
    base, best = (_squares(made, columns, truth, counts) for columns in (known, true))
    if base <= best:
        return None
    return float((base - np.sum((truth - found)[counts] ** 2)) / (base - best))


def _counts(target: str, log: Log) -> NDArray[np.bool_]:
    """Rows that count, (N,): a drive's at rest do not, where friction is what the load asks for."""
    return ~resting(log) if target in DRIVES else np.ones(len(log), dtype=bool)


def base_rows_of(made: Made, number: int) -> Array:
    """Rows and bend of the base in a run, (N, B)."""
    log = made.exact[number]
    columns = [base_rows(e, made.scenes[number], log) for e in made.base]
    return np.column_stack([np.empty((len(log), 0)), *columns])


def _squares(made: Made, columns: list[Array], truth: Array, counts: NDArray[np.bool_]) -> float:
    """Squares on the held-out runs of a fit to the others, noise in both."""
    first = len(made.logs)
    rows = made.sizing.whitened(columns[:first])
    target = made.sizing.whitened([y[:, None] for y in made.measured[:first]])[:, 0]
    beta = np.linalg.lstsq(rows, target, rcond=1e-9)[0]
    return float(np.sum((truth - np.concatenate(columns[first:]) @ beta)[counts] ** 2))
