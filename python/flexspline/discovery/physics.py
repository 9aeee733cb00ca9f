"""What physics allows of an effect: no friction that drives, no loop that gives energy, no negative
mass.

Nor is every curve that a form can bend to the effect of its name. Springs of alternating sign fit
the noise around a reversal; friction that fades before the direction of motion has changed is the
width of that change said twice; one that has not faded at the largest speed is viscous. Stribeck's
friction adds to Coulomb's; a bend by which friction falls from rest is Stribeck's. Gears wind up by
thousandths of a radian under their rated torque: what builds up over a tenth is no presliding. What
a sensor reads of most of the motor's torque is the torque that the gear transmits, and no leakage.
And runs that all go one way show no change of direction.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.settings import SETTINGS
from flexspline.effects import CATALOGUE, traits_of
from flexspline.effects.causes import (
    COULOMB,
    CROSSTALK,
    LAG,
    LOAD_LOOP,
    POLYNOMIAL_FRICTION,
    PRESLIDING,
    STRIBECK,
    VISCOUS,
)
from flexspline.least_squares.options import Bounds
from flexspline.least_squares.problem import Problem
from flexspline.orders.parts import effective_ratio
from flexspline.regression.candidate_model import CandidateModel
from flexspline.regression.gram import TINY

__all__ = ["LOOPS", "WIDTH", "driving_spring", "falling_power", "fastest_of", "held_powers",
           "impossible", "level_of", "one_signed", "spring_bounds"]  # fmt: skip

Array = NDArray[np.float64]

PRESLIDING_WIDTH = "presliding_width"
WIDEST = 0.1  # rad
LOOPS = tuple(
    name for name, info in CATALOGUE.items() if info.traits.loop and info.traits.one_signed
)
"""Elements all have one sign, as loops cost energy: the positive one, but for friction, which a
sensor may see from either side."""

WIDTH = "direction_width"

DRIVES = ("motor_torque", "motor_current")


def one_signed(name: str, target: str) -> int:
    """How many signs the coefficients of an effect may have: 1, 2 of a sensor; 0: any of each."""
    if name in LOOPS:
        return 2 if _either(name, target) else 1
    return int(target in DRIVES and traits_of(name).one_signed)


def impossible(work: CandidateModel, name: str, problem: Problem) -> str:
    """Return why an effect cannot be what the model says of it, "" where it can.

    A loop that is narrower than the noise of the load follows that: the same noise is in the
    target, from which the load is subtracted. The drive decides signs: a sensor may see either, and
    so may what corrects a simulation.
    """
    why = _bent_one_way(work, name, problem) or _not_its_form(work, name, problem)
    return why or (_wrong_sign(work, name, problem) if problem.simulated is None else "")


def _not_its_form(work: CandidateModel, name: str, problem: Problem) -> str:
    """Why the shape of an effect is not its own, "" where it is."""
    if name == STRIBECK and (why := _not_fading(work, problem)):
        return why
    values = work.values(name)
    if name == PRESLIDING and _slip(values, _shapes(work, name)[PRESLIDING_WIDTH]) > WIDEST:
        return f"it would build up over more than {WIDEST:g} rad, as no gear does"
    if name == LOAD_LOOP and values.sum() < 0.0:
        return "a sensor's loop lags behind the torque, and this one would run ahead"
    if name == LOAD_LOOP and _slip(values, _shapes(work, name)["load_width"]) < (
        SETTINGS.told * problem.scatter
    ):
        return "its loop would be no wider than the noise of the load"
    if name == LAG and problem.known_load is not None and values[0] < 0.0:
        return "a sensor cannot read a torque before it is there"
    if name == CROSSTALK and np.abs(values).max() > 0.5 * _ratio(problem):
        return "it would be most of what the gear transmits: the motor carries the load"
    return ""


def _ratio(problem: Problem) -> float:
    """The gear's, from motor to output; without bound where it is not stated."""
    ratio = effective_ratio(problem.runs[0].log.facts)
    return np.inf if ratio is None else abs(ratio)


def _wrong_sign(work: CandidateModel, name: str, problem: Problem) -> str:
    """Why its sign cannot be, "" where it can."""
    values = work.values(name)
    level = level_of(work, COULOMB)
    if name == PRESLIDING and values.sum() * level < 0.0 and abs(values.sum()) < abs(level):
        return "its friction would turn over before the joint does: the motion may be late"
    if name == STRIBECK and values[0] * level < 0.0:
        return "it would lessen friction at low speed, where Stribeck's adds to it"
    if name == POLYNOMIAL_FRICTION and _falls(work, problem):
        return "with it friction would fall as the speed rises from rest, which is Stribeck's"
    if problem.target not in DRIVES:
        return ""
    if not (traits_of(name).one_signed and values.sum() < 0.0):
        return ""
    if traits_of(name).inertial:
        return "its mass would be negative"
    return f"its {'springs' if name in LOOPS else 'friction'} would drive the joint"


def _bent_one_way(work: CandidateModel, name: str, problem: Problem) -> str:
    """Why a change of direction is none, "" where it is one or reaches into no speed."""
    shapes = _shapes(work, name)
    if WIDTH not in shapes:
        return ""
    velocity = np.concatenate([run.log["output_velocity"] for run in problem.runs])
    if min(np.mean(velocity > 0.0), np.mean(velocity < 0.0)) >= SETTINGS.negligible:
        return ""
    if np.tanh(np.quantile(np.abs(velocity), SETTINGS.little) / shapes[WIDTH]) >= SETTINGS.most:
        return ""
    return "no run changes direction, and its change of direction would reach into their speeds"


def _not_fading(work: CandidateModel, problem: Problem) -> str:
    """Why friction does not fade from rest as a start's does, "" where it does."""
    fastest, shapes = fastest_of(problem), _shapes(work, STRIBECK)
    if shapes["stribeck_velocity"] < shapes["direction_width"]:
        return "it would fade before the direction of motion has changed"
    if shapes["stribeck_velocity"] > SETTINGS.most * fastest:
        return "it would not fade within the speeds of these runs"
    return ""


def _falls(work: CandidateModel, problem: Problem) -> bool:
    """Whether friction becomes less by a small part of its level before it rises with the speed.

    Not asked of a drive whose level has the wrong sign.
    """
    level = level_of(work, COULOMB)
    if problem.target in DRIVES and level < 0.0:
        return False
    speeds = np.linspace(0.0, fastest_of(problem), SETTINGS.functions)
    powers = np.array([level_of(work, VISCOUS), *work.values(POLYNOMIAL_FRICTION)])
    curve = speeds[:, None] ** np.arange(1, 1 + len(powers)) @ powers
    return float(np.min(np.sign(level) * curve)) < -SETTINGS.little * abs(level)


def fastest_of(problem: Problem) -> float:
    """Return the largest speed of all runs, rad/s."""
    speeds = (run.log["output_velocity"] for run in problem.runs)
    return problem.once("fastest", lambda: max(float(max(v.max(), -v.min())) for v in speeds))


def driving_spring(work: CandidateModel, target: str) -> str:
    """Return the presliding spring whose sign is most against the others', "" where none is.

    The last free one of an effect stays, whatever its sign.
    """
    against: dict[str, float] = {}
    for effect in LOOPS:
        names, values = _terms(work, effect), work.values(effect)
        free = [k for k, name in enumerate(names) if name not in work.fixed]
        if len(free) > 1:
            side = _side(values, effect, target)
            against |= {names[k]: -side * float(values[k]) for k in free}
    worst = max(against, key=lambda name: against[name], default="")
    return worst if worst and against[worst] > 0.0 else ""


def falling_power(work: CandidateModel, problem: Problem) -> str:
    """Return the power of the speed that makes friction fall from rest, "" where it does not fall.

    Of two powers whose coefficients runs hardly tell apart, one may be below zero by chance. The
    last free one stays, whatever its sign.
    """
    names, values = _terms(work, POLYNOMIAL_FRICTION), work.values(POLYNOMIAL_FRICTION)
    free = [k for k, name in enumerate(names) if name not in work.fixed]
    if len(free) < 2 or not _falls(work, problem):
        return ""
    along = np.sign(level_of(work, COULOMB)) * values
    worst = min(free, key=lambda k: float(along[k]))
    return names[worst] if along[worst] < 0.0 else ""


def held_powers(work: CandidateModel) -> dict[str, float]:
    """Return the powers of the speed that a search holds, by name, as a fit has to."""
    return {n: work.fixed[n] for n in _terms(work, POLYNOMIAL_FRICTION) if n in work.fixed}


def spring_bounds(work: CandidateModel, target: str) -> dict[str, Bounds]:
    """Return the bounds by which a fit keeps the springs of an effect of one sign, by name."""
    found: dict[str, Bounds] = {}
    for effect in LOOPS:
        side = _side(work.values(effect), effect, target)
        own: Bounds = (0.0, None) if side > 0.0 else (None, 0.0)
        found |= dict.fromkeys(_terms(work, effect), own)
    return found


def _side(values: Array, name: str, target: str) -> float:
    """Sign that the elements of an effect have."""
    return -1.0 if _either(name, target) and values.sum() < 0.0 else 1.0


def _either(name: str, target: str) -> bool:
    """Whether the sign is any: a sensor sees friction from either side."""
    return name == PRESLIDING and target == "sensor_torque"


def _slip(levels: Array, width: float) -> float:
    """Where springs slip, in the unit of `width`, in the mean by their levels: w, w/2, w/4, w/8."""
    sizes = np.abs(levels)
    return float(sizes @ (width * 0.5 ** np.arange(len(sizes)))) / max(float(sizes.sum()), TINY)


def _shapes(work: CandidateModel, name: str) -> Mapping[str, float]:
    (shapes,) = (e.shapes for e in work.effects if e.name == name)
    return shapes


def _terms(work: CandidateModel, name: str) -> list[str]:
    return [f"{e.name}.{t.name}" for e in work.effects if e.name == name for t in e.terms]


def level_of(work: CandidateModel, name: str) -> float:
    """Return the first coefficient of an effect, 0 where the model does not have it."""
    return float(next(iter(work.values(name)), 0.0))
