"""A fleet over months: each joint's parameters over calendar time, what changed in which, and when.

Runs become sums as `flexspline.fleet.fit` makes them, by processes of this machine or of a cluster.
The sums of a run by themselves are one session of its joint; `track` says what became of each. Of
many joints one shows more by chance than a joint alone: what evidence has to exceed grows with
their number (`History.among`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from flexspline.effects import Effect
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.fleet import Folders, fit_sums, sessions_from, summed
from flexspline.fleet.accumulators import Plan, RunSums
from flexspline.fleet.cluster import Workers, done, require_some, split_failed, staying
from flexspline.fleet.estimates import estimate_of
from flexspline.fleet.result import FleetFit, FleetResult
from flexspline.fleet.sessions import Sessions
from flexspline.progress import Progress
from flexspline.tracking import HORIZON, track
from flexspline.tracking.history import History, ranges_by_channel
from flexspline.tracking.result import Change, Track, day, days_of, spoken

if TYPE_CHECKING:
    import pandas
    from distributed import Client

    from flexspline.model import Model

__all__ = ["FleetTrack", "history_of_sums", "track_fleet"]


@dataclass(frozen=True, eq=False, repr=False)
class FleetTrack(FleetResult):
    """The joints of a fleet over months.

    Parameters
    ----------
    fit : of the fleet, over all sessions together.
    tracks : of each joint, by its name.
    failed : (joint or run, why) of what was left out.
    remarks : sentences about the folders.
    """

    _kind: ClassVar = "fleet_track"

    fit: FleetFit
    tracks: Mapping[str, Track]
    failed: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]

    def __getitem__(self, joint: str) -> Track:
        """Return the track of a joint."""
        if joint not in self.tracks:
            raise InputError(
                f"no joint '{joint}' is tracked{did_you_mean(joint, self.tracks)}; those that are: "
                f"{listed(self.tracks)}"
            )
        return self.tracks[joint]

    @property
    def changed(self) -> dict[str, tuple[Change, ...]]:
        """Changes of each joint that has some, by their dates; the surest joint first."""
        some = [(name, made.changes) for name, made in self.tracks.items() if made.changes]
        some.sort(key=lambda pair: min(c.needed - c.evidence for c in pair[1]))
        return dict(some)

    @property
    def quiet(self) -> tuple[str, ...]:
        """Joints of which enough is known and no change is told."""
        return tuple(n for n, made in self.tracks.items() if made.known and not made.changes)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Joints with too few sessions to tell a change."""
        return tuple(name for name, made in self.tracks.items() if not made.known)

    @property
    def verdict(self) -> str:
        """What there is to decide, in a sentence or two."""
        count = len(self.tracks)
        span = days_of(np.concatenate([made.history.dates for made in self.tracks.values()]))
        told = len(self.changed)
        said = f"{count} joint{'s' if count > 1 else ''}, {span}: "
        said += f"{listed(self.changed)} changed" if told else "no change is told"
        verb = "is" if len(self.quiet) == 1 else "are"
        said += f", {len(self.quiet)} {verb} quiet" if told and self.quiet else ""
        return said + (f", of {len(self.unknown)} nothing is known yet." if self.unknown else ".")

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each change."""
        import pandas

        return pandas.DataFrame(
            [
                {
                    "joint": name,
                    "cause": " or ".join(map(spoken, change.causes)),
                    "date": change.date.date(),
                    "from": change.between[0].date(),
                    "to": change.between[1].date(),
                    "parameter": change.parameter,
                    "size": change.size,
                    "error": change.error,
                    "unit": change.unit,
                    "kind": change.kind or "not known yet",
                    "told_since": change.told_since.date(),
                    "needs": change.needs,
                }
                for name, changes in self.changed.items()
                for change in changes
            ],
            columns=["joint", "cause", "date", "from", "to", "parameter", "size", "error", "unit",
                     "kind", "told_since", "needs"],
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Return it as `fleet_track.json` holds it; each joint's own `track.json` has the rest."""
        content = {
            "target": self.fit.plan.target,
            "verdict": self.verdict,
            "changed": {
                name: [
                    {
                        "causes": [spoken(cause) for cause in c.causes],
                        "date": day(c.date),
                        "sentence": c.sentence,
                    }
                    for c in changes
                ]
                for name, changes in self.changed.items()
            },
            "quiet": list(self.quiet),
            "unknown": list(self.unknown),
        }
        return self._file(content)

    def __repr__(self) -> str:
        return f"<FleetTrack: {len(self.tracks)} joints, {len(self.changed)} changed>"


def track_fleet(
    folders: Folders | Sessions,
    target: str | None = None,
    effects: str | Effect | Iterable[str | Effect] | None = None,
    *,
    model: Model | None = None,
    pilot: str | None = None,
    known_load: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    limits: Mapping[str, float | str] | None = None,
    horizon: float = HORIZON,
    scheduler: str | Client | None = None,
    workers: int | None = None,
    progress: bool = False,
    **reading: Any,
) -> FleetTrack:
    """Say what changed in which joint of a fleet, since when, by how much, and what comes.

    Parameters
    ----------
    folders, target, effects, model, pilot, known_load, lowpass, bandwidth, orders, fixed, scheduler
        As for `flexspline.fleet.fit`, as are `workers`, `progress` and `reading`. Every run needs a
        date: in its file's name, in a table (`dates`), or as a fact.
    limits, horizon : as for `track`; of every joint.

    Returns
    -------
    FleetTrack

    Raises
    ------
    InputError
        As `flexspline.fleet.fit`; and where no run has a date, or for an impossible limit.
    """
    sessions = sessions_from(folders, reading)
    how: dict[str, Any] = {"known_load": known_load, "lowpass": lowpass, "bandwidth": bandwidth}
    how |= {"fixed": dict(fixed or {}), "checks": True}
    with staying(Workers(scheduler, workers)) as whose:
        plan, made, failed = summed(
            sessions, target, effects, (model, pilot, orders, ()), how, whose, progress
        )
        fitted = fit_sums(made, plan, failed, sessions.remarks)
        histories, left = _histories(made, plan)
        ask = partial(track, limits=limits, horizon=horizon)
        ask(histories[0])  # a limit that is wrong is so for all
        with Progress("joints", progress, total=len(histories), unit="joint") as bar:
            tracks = done(ask, histories, whose, bar)
    told, lost = split_failed([history.joint for history in histories], tracks)
    return FleetTrack(
        fitted,
        {made.history.joint: made for made in told},
        (*fitted.failed, *left, *lost),
        fitted.remarks,
    )


def _histories(runs: Sequence[RunSums], plan: Plan) -> tuple[list[History], list[tuple[str, str]]]:
    """Return the history of each joint that has dates, and (joint or run, why) of the others."""
    joints: dict[str, list[RunSums]] = {}
    failed = []
    for run in runs:
        if run.date is None:
            why = "has no date; put it into the file's name as 2027-03-14, or give --dates"
            failed.append((run.label, why))
            continue
        joints.setdefault(run.unit, []).append(run)
    histories = []
    for name in sorted(joints):
        try:
            histories.append(history_of_sums(joints[name], plan))
        except InputError as error:
            failed.append((name, str(error)))
    require_some(histories, failed, "no other joint can be tracked")
    return [replace(each, among=len(histories)) for each in histories], failed


def history_of_sums(runs: Sequence[RunSums], plan: Plan) -> History:
    """Return the history of a joint, each of whose runs is a session by itself.

    Raises
    ------
    InputError
        Where no run by itself determines a parameter.
    """
    width = len(plan.names)
    values, errors, kept, remarks = [], [], [], []
    for run in sorted(runs, key=lambda run: (str(run.date), run.run)):
        try:
            told = estimate_of([run])
        except InputError as error:
            remarks.append(f"{run.run} is left out: {error}")
            continue
        known = told.determined
        values.append(np.where(known, told.values, np.nan))
        errors.append(np.where(np.outer(known, known), told.covariance, np.nan))
        kept.append(run)
    if not kept or not np.isfinite(values).any():
        raise InputError(
            f"no run by itself determines a parameter of {listed(plan.names)}; record longer runs, "
            "or leave effects out"
        )
    return History(
        np.array([run.date for run in kept], dtype="datetime64[s]"),
        plan.names,
        plan.units,
        np.reshape(values, (-1, width)),
        np.reshape(errors, (-1, width, width)),
        np.array([np.nan if run.temperature is None else run.temperature for run in kept]),
        tuple(run.run for run in kept),
        kept[0].unit,
        tuple(remarks),
        ranges=ranges_by_channel([run.ranges for run in kept]),
        target=plan.target,
    )
