"""The plan in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

from flexspline.effects import CATALOGUE
from flexspline.experiment.plan import ENOUGH, TAKEN, Outlook
from flexspline.experiment.words import joined, short
from flexspline.formatting.numbers import short_names

__all__ = ["plan_sentence"]

ALIKE = 0.05  # t below which there is nothing to build on
OFTEN = 20  # repetitions that are worth saying


def plan_sentence(
    seconds: float, words: str, outlooks: Sequence[Outlook], times: int, own_load: bool
) -> str:
    """Return what to record, what it settles, and what it does not.

    `own_load`: whether the load is what inertia and gravity of the joint make.
    """
    settled = [o for o in outlooks if o.settled]
    open_ = [o for o in outlooks if not o.settled]
    run = f"{short(seconds)} s of {words}"
    run = f"{times} times {run}" if times > 1 else run
    said = []
    if settled:
        told = joined(_settled(o) for o in settled)
        said.append(f"Record {run}: with it {told}.")
    said += [_near(o, own_load) for o in settled if o.taken >= TAKEN]
    said += [_open(o, None if settled else run) for o in open_]
    return short_names(" ".join(said))


def _settled(one: Outlook) -> str:
    if one.parameter:
        return f"{one.names[0]} would be known to ± {short(one.expected)} {one.unit} ({_now(one)})"
    return (
        f"{one.names[0]} and {one.names[1]} would stand apart at t = {_t(one.expected)} "
        f"({_now(one)})"
    )


def _near(one: Outlook, own_load: bool) -> str:
    named, rival = one.names
    said = f"Even then {rival} would explain {100.0 * one.taken:.0f} % of what {named} explains"
    if own_load and any("load" in CATALOGUE[name].reads for name in one.names):
        return f"{said}: a payload of known torque (reference_torque) would tell more."
    return f"{said}: wider limits would tell more."


def _now(one: Outlook) -> str:
    if not one.parameter:
        if one.now < ENOUGH:
            return f"now {_t(one.now)}"
        return f"now {_t(one.now)} if {one.names[0]} is right, which these runs do not bear out"
    return f"now ± {short(one.now)}" if one.now < float("inf") else "now nothing is known of it"


def _open(one: Outlook, run: str | None) -> str:
    best = f"the best, {run}, reaches" if run else "this one reaches"
    if one.parameter and not one.expected < one.now:
        better = f"makes {one.names[0]} known better"
        does = better if one.now < float("inf") else f"determines {one.names[0]}"
        return f"No run within these limits {does} ({_now(one)}){_doubled(one, '± ')}."
    if one.parameter:
        reached = f"± {short(one.expected)} {one.unit} ({_now(one)})"
        said = f"No run within these limits determines {one.names[0]}: {best} {reached}"
        return f"{said}{_doubled(one, '± ')}."
    who = f"{one.names[0]} and {one.names[1]}"
    if one.doubled is None and one.expected < ALIKE:
        said = f"No motion within these limits or twice as wide ones tells {who} apart (t = 0)"
        return f"{said}: all that can be commanded acts on both alike.{_mounting(one)}"
    reached = f"t = {_t(one.expected)} ({_now(one)})"
    said = f"No run within these limits tells {who} apart: {best} {reached}"
    return f"{said}{_often(one)}{_doubled(one, 't = ')}.{_mounting(one)}"


def _often(one: Outlook) -> str:
    gained = one.expected**2 - one.now**2
    times = int((ENOUGH**2 - one.now**2) / max(gained, 1e-9)) + 1
    return f", recorded {times} times t = {ENOUGH:g}" if 1 < times <= OFTEN else ""


def _doubled(one: Outlook, sign: str) -> str:
    if one.doubled is None:
        return "; nor would twice as wide limits help"
    name, value, reached = one.doubled
    return f"; the {name} binds: up to {value}, {sign}{short(reached)} could be reached"


def _mounting(one: Outlook) -> str:
    if "gravity" not in one.names:
        return ""
    (other,) = (name for name in one.names if name != "gravity")
    return (
        " Turn the joint's axis upright and record this run there: gravity then disappears, "
        f"{other} stays."
    )


def _t(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"
