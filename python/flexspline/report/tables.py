"""Tables of scores, of one fit by group or several side by side, and of the noise of channels."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.constants import milli

from flexspline.errors import InputError, listed
from flexspline.formatting import decimals_for, plus_minus, rows_text, short, short_names, truncated
from flexspline.least_squares.validation import Score
from flexspline.logs.channels import CHANNELS

if TYPE_CHECKING:
    import pandas

    from flexspline.least_squares.per_run_terms import BetweenRuns
    from flexspline.least_squares.result import Delay, Fit
    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.prepared import Preparation

__all__ = [
    "ScoreTable",
    "between_rows",
    "between_sentences",
    "compare_scores",
    "delay_sentence",
    "grouped_scores",
    "input_rows",
    "late_of",
    "score_rows",
    "smoothed_rows",
]

MOST_RUNS = 12
UNDETERMINED = "not determined"
WORST_RUNS = 5

_GROUPS = {
    "all": "all",
    "run": "by run",
    "direction": "by direction",
    "speed": "by speed",
    "temperature": "by temperature",
    "reversals": "near reversals",
}

_LATEX = str.maketrans(
    {
        **{sign: f"\\{sign}" for sign in "&%$#_{}"},
        "\\": "\\textbackslash{}",
        "^": "\\textasciicircum{}",
        "~": "\\textasciitilde{}",
        "°": "$^\\circ$",
        "±": "$\\pm$",
    }
)

AS_RECORDED = "as recorded"
LATE = 0.05
"""Of a row, from which the delay of a velocity is told, as the checks of encoders tell theirs."""
HEADING = ("channel", "noise, RMS", "quantum", "bandwidth [Hz]", "late [ms]", "as the rows read it")

Row = tuple[str, ...]


def score_rows(scores: Sequence[Score], unit: str) -> list[tuple[str, ...]]:
    """Return heading and rows of the scores of one fit, as text.

    Of more than a dozen runs only the worst are shown.
    """
    decimals = decimals_for(scores[0].cv_rmse)
    found: list[tuple[str, ...]] = [
        ("", "rows", f"RMSE [{unit}]", f"held out [{unit}]", f"bias [{unit}]", "R²")
    ]
    for entry in _shown(scores):
        numbers = (_fixed(x, decimals) for x in (entry.rmse, entry.cv_rmse, entry.bias))
        label = _named(entry.group, entry.label)
        found.append((label, str(entry.rows), *numbers, truncated(entry.r_squared)))
    return found


def grouped_scores(scores: Sequence[Score]) -> list[tuple[str, list[tuple[str, ...]]]]:
    """Return the scores of one fit by group: title, then label, rows, RMSE, RMSE held out, bias,
    variance and R² as text; every run is there."""
    decimals = decimals_for(scores[0].cv_rmse)
    found = []
    for group, members in groupby(_telling(scores), lambda entry: entry.group):
        rows = [
            (
                entry.label,
                str(entry.rows),
                *(_fixed(x, decimals) for x in (entry.rmse, entry.cv_rmse, entry.bias)),
                f"{entry.variance:#.3g}".rstrip("."),
                truncated(entry.r_squared),
            )
            for entry in members
        ]
        found.append((_GROUPS[group], rows))
    return found


def _fixed(value: float, decimals: int) -> str:
    """Return a number with so many decimals, never "-0.000"."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def _telling(scores: Sequence[Score]) -> list[Score]:
    """Order by group, without parts that hold all rows: these say what the first line says."""
    told = [s for s in scores if s.group == "all" or s.rows < scores[0].rows]
    return sorted(told, key=lambda s: list(_GROUPS).index(s.group))


def _shown(scores: Sequence[Score]) -> list[Score]:
    scores = _telling(scores)
    runs = [entry for entry in scores if entry.group == "run"]
    if len(runs) <= MOST_RUNS:
        return scores
    worst = sorted(runs, key=lambda entry: -entry.cv_rmse)[:WORST_RUNS]
    return [entry for entry in scores if entry.group != "run" or entry in worst]


def _named(group: str, label: str) -> str:
    """Say what a label is of, where it does not say so itself."""
    if group in ("all", "reversals", "direction") or label.startswith(group):
        return label
    return f"{group} {label}"


@dataclass(frozen=True, eq=False)
class ScoreTable:
    """Cross-validated RMSE of several fits, a row for each part of the logs.

    Parameters
    ----------
    rows : (group, label) of each part, such as ("speed", "0.1 to 0.5 rad/s").
    models : names of the fits.
    values : (rows, models), RMSE on held-out rows in `unit`; NaN where a fit has no such part.
    unit : of the target.
    """

    rows: tuple[tuple[str, str], ...]
    models: tuple[str, ...]
    values: NDArray[np.float64]
    unit: str

    @property
    def title(self) -> str:
        return f"RMSE on held-out rows [{self.unit}]"

    def best(self) -> NDArray[np.bool_]:
        """Return which fit is best in each row, as printed, (rows, models)."""
        rounded = np.round(self.values, self._decimals)
        lowest = np.nanmin(rounded, axis=1, keepdims=True, initial=np.inf)
        several = np.isfinite(rounded).sum(axis=1, keepdims=True) > 1
        return np.asarray((rounded == lowest) & several)

    def to_frame(self) -> pandas.DataFrame:
        """Return the unrounded values, indexed by group and label."""
        import pandas

        index = pandas.MultiIndex.from_tuples(self.rows, names=["group", "label"])
        return pandas.DataFrame(self.values, index=index, columns=list(self.models))

    def to_html(self) -> str:
        """Return a table; the best of each row is bold."""
        head = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in self.models)
        lines = [f'<tr><th scope="col">{html.escape(self.title)}</th>{head}</tr>']
        for label, cells, marks in self._cells():
            numbers = "".join(
                f"<td><b>{cell}</b></td>" if mark else f"<td>{cell}</td>"
                for cell, mark in zip(cells, marks, strict=True)
            )
            lines.append(f'<tr><th scope="row">{html.escape(label)}</th>{numbers}</tr>')
        return '<table class="scores">' + "".join(lines) + "</table>"

    def to_latex(self) -> str:
        """Return a tabular with booktabs rules; the best of each row is bold."""
        head = " & ".join(_latex(name) for name in (self.title, *self.models))
        lines = [f"\\begin{{tabular}}{{l{'r' * len(self.models)}}}", "\\toprule", f"{head} \\\\"]
        lines.append("\\midrule")
        for label, cells, marks in self._cells():
            numbers = [
                f"\\textbf{{{cell}}}" if mark else cell
                for cell, mark in zip(cells, marks, strict=True)
            ]
            lines.append(" & ".join([_latex(label), *numbers]) + " \\\\")
        return "\n".join([*lines, "\\bottomrule", "\\end{tabular}", ""])

    def __str__(self) -> str:
        table = [(self.title, *self.models)]
        for label, cells, marks in self._cells():
            starred = (f"{c} *" if m else f"{c}  " for c, m in zip(cells, marks, strict=True))
            table.append((label, *starred))
        return "\n".join([rows_text(table), "* best of its row"])

    def _repr_html_(self) -> str:
        return self.to_html()

    @property
    def _decimals(self) -> int:
        return decimals_for(float(np.nanmin(self.values)))

    def _cells(self) -> list[tuple[str, list[str], NDArray[np.bool_]]]:
        found = []
        for (group, label), values, marks in zip(self.rows, self.values, self.best(), strict=True):
            cells = [f"{v:.{self._decimals}f}" if np.isfinite(v) else "–" for v in values]
            found.append((_named(group, label), cells, marks))
        return found


def compare_scores(fits: Mapping[str, Fit]) -> ScoreTable:
    """Return the cross-validated RMSE of several fits of the same logs, by bands.

    Parameters
    ----------
    fits : {"smooth": fit, "ripple": fit}, all of one target.

    Raises
    ------
    InputError
        Where there is no fit, or the fits have different targets.
    """
    if not fits:
        raise InputError("there is no fit to compare; give at least one by name")
    targets = {fit.target for fit in fits.values()}
    if len(targets) > 1:
        raise InputError(
            f"the fits are of {listed(sorted(targets))}; compare fits of one target only"
        )
    known = {
        name: {(s.group, s.label): s.cv_rmse for s in fit.scores} for name, fit in fits.items()
    }
    rows = tuple(dict.fromkeys(row for table in known.values() for row in table))
    values = np.array([[table.get(row, np.nan) for table in known.values()] for row in rows])
    unit = next(iter(fits.values())).unit
    return ScoreTable(rows, tuple(known), values, unit)


def _latex(text: str) -> str:
    return text.translate(_LATEX)


def input_rows(
    inputs: Sequence[ChannelNoise],
    ways: Sequence[Preparation],
    late: Mapping[str, float] | None = None,
) -> list[Row]:
    """Return channel with unit, noise, quantum, bandwidth, delay and how rows read it, for a table.

    Parameters
    ----------
    inputs : noise of the channels of the runs.
    ways : how channels are made before rows read them; some may be in no run.
    late : s, by channel, where it was found; else the delay that its noise tells.
    """
    used = {way.channel: way.how for way in ways}
    own = {noise.channel for noise in inputs}
    seen = {n.channel: n.delay for n in inputs if abs(n.delay) * n.rate > LATE}
    delays = seen | dict(late or {})
    told: list[Row] = [
        (
            _channel_named(noise.channel),
            short(noise.noise),
            short(noise.quantum) if noise.quantum else "–",
            f"{noise.bandwidth:.3g}" if noise.noisy else f"above {noise.bandwidth:.3g}",
            short(delays[noise.channel] / milli) if noise.channel in delays else "–",
            used.get(noise.channel, AS_RECORDED),
        )
        for noise in inputs
    ]
    return told + [
        (_channel_named(w.channel), "–", "–", "–", "–", w.how) for w in ways if w.channel not in own
    ]


def smoothed_rows(
    inputs: Sequence[ChannelNoise],
    ways: Sequence[Preparation],
    read: Sequence[str],
    late: Mapping[str, float] | None = None,
) -> list[Row]:
    """Return heading and those rows of the table whose channel is `read` other than recorded."""
    names = {_channel_named(way.channel) for way in ways if way.channel in read}
    rows = [row for row in input_rows(inputs, ways, late) if row[0] in names]
    return [HEADING, *rows] if rows else []


def late_of(delay: Delay | None) -> dict[str, float]:
    """Return by how much the load is late, s by its channel; empty where it was not looked for."""
    return {} if delay is None else {delay.channel: delay.seconds}


def delay_sentence(delay: Delay | None, unit: str) -> str:
    """Return by how much the load is late, and what that does; "" where it was not looked for."""
    if delay is None:
        return ""
    late = plus_minus(1e3 * delay.seconds, 1e3 * delay.standard_error)
    return (
        f"{delay.channel} is {late} ms later than the target; coefficients are those beside this "
        f"delay, which makes {short(delay.rmse)} {unit} of the residual."
    )


def _channel_named(channel: str) -> str:
    return f"{channel} [{CHANNELS[channel].unit if channel in CHANNELS else 'Nm'}]"


def between_rows(fit: Fit) -> list[tuple[str, ...]]:
    """Return a head, and a line for each run, their mean and their spread, of terms of their own.

    Empty where the runs share all terms. Of many runs the first ones are shown.
    """
    terms = fit.between_runs
    if not terms:
        return []
    head = ("run", *(f"{short_names(term.term)} [{term.unit}]" for term in terms))
    rows = [
        (name, *(_own_value(term, k) for term in terms))
        for k, name in enumerate(terms[0].runs[:MOST_RUNS])
    ]
    left = len(terms[0].runs) - len(rows)
    if left:
        rows.append((f"{left} more", *("" for _ in terms)))
    means = (plus_minus(t.mean, t.new_run_error) if _told(t) else UNDETERMINED for t in terms)
    spreads = (short(t.spread) if _told(t) and np.isfinite(t.spread) else "–" for t in terms)
    return [head, *rows, ("mean ± for a new run", *means), ("spread between runs", *spreads)]


def _told(term: BetweenRuns) -> bool:
    """Whether two runs determine the term, or its values are given."""
    return sum(term.determined) > 1 or not any(term.standard_errors)


def _own_value(term: BetweenRuns, number: int) -> str:
    value, error = term.values[number], term.standard_errors[number]
    if error == 0.0:
        return short(value)
    return plus_minus(value, error) if term.determined[number] else UNDETERMINED


def between_sentences(fit: Fit) -> list[str]:
    """Return whether the runs differ, and how well a run that is none of them is predicted."""
    terms = fit.between_runs
    if not terms:
        return []
    said = [f"{short_names(term.term)}: {term.verdict}." for term in terms]
    rmse, runs = terms[0].new_run_rmse, len(terms[0].runs)
    said.append("The model predicts a new run with the mean.")
    if np.isfinite(rmse):
        said.append(
            f"That leaves {short(rmse)} {fit.unit} RMSE: of fits that leave out each of the {runs} "
            "runs in turn and predict it with the mean of the others. The held-out error is of "
            "blocks of runs whose other rows are known, and their own values with them."
        )
        if rmse < fit.cv_rmse:
            said.append(
                "It is the lower of the two: the other rows of a run tell its own values worse "
                "than the mean of the other runs does."
            )
    else:
        said.append(
            "How much that leaves is not known: without one of the runs the others do not "
            "determine all terms."
        )
    return said
