"""A model's torsion as what couples two hinges of a simulator: motor side and link.

The core has the torque that belongs to a torsion (`flexspline/coupling.hpp`). For that the torsion
has to grow with the load everywhere, also just behind a reversal, where all of a loop sticks; how
little it grows at least is the largest stiffness, and that bounds a simulator's timestep.

Of the part's effects run those that twist by the load, or by the motor's torque, which is the Ñth
part of it where one torque passes all. Left out are

- zeros of the encoders and their drift, for hinges have none,
- the kinematic error, which moves the link and twists no more,
- a loop on the path of the motor's angle, which may give more work than it takes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.effects.causes import KINEMATIC_ERROR, TORSION_LOOP
from flexspline.errors import InputError, listed
from flexspline.model import PART_OF, Model, Part
from flexspline.own import design_of
from flexspline.signals import gear_of

__all__ = ["TORSION", "Coupling", "coupling_of", "kept_effects", "read_temperatures",
           "usual_temperature", "without_log"]  # fmt: skip

Array = NDArray[np.float64]

TORSION = "torsion"
TORQUES = ("load", "motor_torque")
USUAL_TEMPERATURE = 25.0  # deg C, as in the core's sample
ANY_TEMPERATURE = (-1e9, 1e9)  # deg C, of a fit that knows no range
LOADS = 2001  # at which the torsion is looked at, of a range both ways
TEMPERATURES = 5  # likewise
REVERSED = 1e-6  # share of the largest load behind a reversal at which all of a loop sticks
SHARE_OF_MEAN = 0.1
"""A model is asked up to the load from which on, just behind a reversal, the torsion grows by less
than this share of its mean. Stiffness goes by the inverse: with half of it a simulator's timestep
has to be 1.4 times as short and the model goes a little further, with twice of it the other way."""
SHARE_OF_LOADS = 0.5
"""The least share of the fit's loads up to which that has to be; what is asked for less, such as a
backlash in a gear that is rigid otherwise, is mostly the straight line beyond. A mesh that stiffens
and a loop of usual size are asked up to 0.8; no number of a model that is taken depends on it."""


@dataclass(frozen=True)
class Coupling:
    """What of a model's torsion twists between two hinges.

    Parameters
    ----------
    model : with one part, whose effects yield; for a log with the torque as `reference_torque`, and
        its Ñth part as `motor_torque`, it says the torsion that the torque belongs to.
    part : that part.
    ratio : Ñ.
    temperature : deg C, the middle of the fit's range, else 25.
    temperatures : deg C, within which the model is asked.
    largest_load : Nm at the output, up to which the model is asked; beyond it is straight.
    fitted_load : Nm at the output, up to which the fit knows it; the largest one, unless a loop
        that sticks leaves too little of a mesh that stiffens.
    least_compliance : rad at the motor per Nm at the output, the least anywhere.
    left : effects that do not run, and why.
    """

    model: Model
    part: Part
    ratio: float
    temperature: float
    temperatures: tuple[float, float]
    largest_load: float
    fitted_load: float
    least_compliance: float
    left: Mapping[str, str]

    @property
    def stiffness(self) -> float:
        """The largest, Nm/rad at the output."""
        return self.ratio / self.least_compliance

    def longest_step(self, motor_inertia: float, link_inertia: float) -> float:
        """Return the timestep [s] at which an explicit step gets unstable, undamped.

        Parameters
        ----------
        motor_inertia, link_inertia : kg m² at the output.
        """
        lightness = 1.0 / motor_inertia + 1.0 / link_inertia
        return float(2.0 / np.sqrt(self.stiffness * lightness))


def coupling_of(model: Model) -> Coupling:
    """Return what of a model's torsion couples two hinges.

    Raises
    ------
    InputError
        Where the model has no torsion, none of its effects yields to a load, the gear ratio or the
        range of loads is missing, or where the torsion does not grow with the load up to half of
        the fit's or a loop has coefficients below zero: then no torque belongs to a torsion, or the
        coupling gives more work than it takes.
    """
    whole = model.part(TORSION)
    if whole.simulated is not None:
        raise InputError(
            "the model's part for torsion corrects a simulation, and a coupling needs all of it; "
            "fit it without the simulation"
        )
    effects, left = kept_effects(
        whole, _left, "that yields to a load", "fit a compliance, with --known-load"
    )
    if "gear_ratio" not in model.facts:
        raise InputError(
            "the model lacks the gear ratio, which relates both sides of the gear; fit it again "
            "with --gear-ratio"
        )
    ratio = float(gear_of(model.facts, motor_encoder=False)["effective_ratio"])
    ranges = whole.record.get("validity", {})
    part = without_log(whole.keeping(lambda e: e.name not in left), known_load="reference_torque")
    _require_braking(part)
    temperatures = read_temperatures(ranges)
    fitted = _fitted_load(effects, ranges, ratio)
    largest, least = _range_of_growth(model, part, ratio, fitted, temperatures)
    return Coupling(
        Model({PART_OF[part.target]: part}, model.facts),
        part,
        ratio,
        usual_temperature(ranges),
        temperatures,
        largest,
        fitted,
        least,
        left,
    )


def kept_effects(
    whole: Part, left_by: Callable[[Effect], str], that: str, remedy: str
) -> tuple[tuple[Effect, ...], dict[str, str]]:
    """Return the effects of a part that run, and of the others what `left_by` says.

    `that` and `remedy`: what an effect that runs does, and what to do where there is none.

    Raises
    ------
    InputError
        Where none of those that run has a coefficient.
    """
    left = {effect.name: why for effect in whole.effects if (why := left_by(effect))}
    kept = tuple(effect for effect in whole.effects if effect.name not in left)
    if not any(effect.terms for effect in kept):
        raise InputError(
            f"the model's part for {whole.target} has no effect {that}: "
            f"{listed(left) or 'it is empty'}; {remedy}"
        )
    return kept, left


def read_temperatures(ranges: Mapping[str, Sequence[float]]) -> tuple[float, float]:
    """Return between which temperatures [deg C] a model of these ranges is asked."""
    low, high = ranges.get("temperature", ANY_TEMPERATURE)
    return float(low), float(high)


def usual_temperature(ranges: Mapping[str, Sequence[float]]) -> float:
    """Return the middle [deg C] of the temperatures of a fit, else that of the core's sample."""
    return 0.5 * sum(read_temperatures(ranges)) if "temperature" in ranges else USUAL_TEMPERATURE


def _left(effect: Effect) -> str:
    """Why an effect does not run; nothing where it does."""
    reads = {*effect.reads}
    if effect.name == TORSION_LOOP and not reads & {*TORQUES}:
        return "a loop on the path of the motor's angle may give more work than it takes"
    if effect.name == KINEMATIC_ERROR:
        return "it moves the link, and twists no more"
    if not reads & {*TORQUES}:
        return "a zero of encoders, which hinges have not"
    beyond = reads - {*TORQUES, "temperature"}
    return f"it reads {listed(sorted(beyond))} beside a torque" if beyond else ""


def without_log(part: Part, known_load: str | None) -> Part:
    """Return the part for a simulator: nothing of its log's encoders and filter, another load.

    A simulator's load is what the joint transmits, the weight of its bodies in it.
    """
    of_log = ("channels", "prepared", "carried")
    record = {key: value for key, value in part.record.items() if key not in of_log}
    return replace(part, known_load=known_load, record=record)


def _require_braking(part: Part) -> None:
    """Refuse a loop that is run through the wrong way round."""
    for effect, coefficients in part.by_effect():
        if effect.info.traits.dissipative and (coefficients < 0.0).any():
            worst = f"{effect.name}.{effect.terms[int(np.argmin(coefficients))].name}"
            raise InputError(
                f"{worst} of the torsion is {coefficients.min():.3g} {part.unit}, by which each "
                f"turn of its loop would give energy; fit it again with --bound {worst}=0:, or "
                "without the effect"
            )


def _fitted_load(
    effects: Sequence[Effect], ranges: Mapping[str, Sequence[float]], ratio: float
) -> float:
    """Up to which load [Nm] at the output the fit knows what twists."""
    of_range = {"load": ("known_load", 1.0), "motor_torque": ("motor_torque", ratio)}
    reads = {channel for effect in effects for channel in effect.reads}
    known = [
        factor * max(map(abs, ranges[name]))
        for channel, (name, factor) in of_range.items()
        if channel in reads and name in ranges
    ]
    if not known or not min(known) > 0.0:
        raise InputError(
            "the model's part for torsion does not say up to which load it was fitted, and so not "
            "how stiff it gets; fit it again to runs with a load"
        )
    return float(min(known))


def _range_of_growth(
    model: Model, part: Part, ratio: float, fitted: float, temperatures: tuple[float, float]
) -> tuple[float, float]:
    """Up to which load [Nm] the torsion grows enough, and by how much at least [rad/Nm].

    All of a loop sticks, as just behind a reversal.
    """
    design = design_of(part.effects, gear_of(model.facts, motor_encoder=False))
    loops = np.concatenate([np.full(len(e.terms), e.info.remembers) for e in part.effects])

    def torsions(loads: Array, of: NDArray[np.bool_], temperature: float) -> Array:
        channels = {"known_load": loads, "motor_torque": loads / ratio}
        channels["temperature"] = np.full(len(loads), temperature)
        rows = np.asarray(design.rows(channels, len(loads), part.coefficients))
        return np.asarray(rows[:, of] @ part.coefficients[of])

    reads_temperature = any("temperature" in effect.reads for effect in part.effects)
    known = temperatures != ANY_TEMPERATURE and reads_temperature
    warm = np.linspace(*temperatures, TEMPERATURES) if known else np.array([USUAL_TEMPERATURE])
    behind = np.array([0.0, REVERSED * fitted])
    loads = np.linspace(-fitted, fitted, LOADS)
    grows, mean = np.full(LOADS - 1, np.inf), 0.0
    for temperature in warm:
        sticking = np.diff(torsions(behind, loops, temperature))[0] / behind[1]
        twisted = torsions(loads, ~loops, temperature)
        mean = max(mean, float(np.abs(twisted[-1] - twisted[0]) / (2.0 * fitted)))
        grows = np.minimum(grows, -np.diff(twisted) / np.diff(loads) - sticking)
    ends = np.maximum(np.abs(loads[1:]), np.abs(loads[:-1]))
    short = ~(grows > SHARE_OF_MEAN * mean)
    largest = float(ends[~short & (ends < ends[short].min(initial=np.inf))].max(initial=0.0))
    if largest < SHARE_OF_LOADS * fitted:
        worst = int(np.argmin(grows))
        raise InputError(
            f"the torsion of the model grows by {grows[worst]:.3g} rad at the motor per Nm at "
            f"{loads[worst]:.3g} Nm just behind a reversal, and by enough up to {largest:.3g} of "
            f"{fitted:.3g} Nm alone, so that hardly a torque belongs to it; fit it with a mesh "
            "that gives way, and with a loop no larger than the runs determine"
        )
    return largest, float(grows[ends <= largest].min())
