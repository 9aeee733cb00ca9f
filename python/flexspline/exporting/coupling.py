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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.effects.causes import KINEMATIC_ERROR, TORSION_LOOP
from flexspline.errors import InputError, listed
from flexspline.model import PART_OF, Model, Part
from flexspline.own import design_of
from flexspline.signals import gear_of

__all__ = ["TORSION", "Coupling", "coupling_of", "read_temperatures"]

Array = NDArray[np.float64]

TORSION = "torsion"
TORQUES = ("load", "motor_torque")
USUAL_TEMPERATURE = 25.0  # deg C, as in the core's sample
ANY_TEMPERATURE = (-1e9, 1e9)  # deg C, of a fit that knows no range
LOADS = 2001  # at which the torsion is looked at, of a range both ways
TEMPERATURES = 5  # likewise
REVERSED = 1e-6  # share of the largest load behind a reversal at which all of a loop sticks
RIGID = 1e-6
"""A compliance that falls below this share of the mean one is none. Stiffness goes by its inverse,
so a timestep would have to be a thousandth of what the mean needs; ten times as much or as little
moves the border between a refusal and such a timestep, and no number of a model that is taken."""


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
    largest_load : Nm at the output, up to which the fit knows it; beyond it is straight.
    least_compliance : rad at the motor per Nm at the output, the least anywhere.
    left : effects that do not run, and why.
    """

    model: Model
    part: Part
    ratio: float
    temperature: float
    temperatures: tuple[float, float]
    largest_load: float
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
        range of loads is missing, or where the torsion does not grow with the load everywhere or a
        loop has coefficients below zero: then no torque belongs to a torsion, or the coupling
        gives more work than it takes.
    """
    whole = model.part(TORSION)
    if whole.simulated is not None:
        raise InputError(
            "the model's part for torsion corrects a simulation, and a coupling needs all of it; "
            "fit it without the simulation"
        )
    left = {effect.name: why for effect in whole.effects if (why := _left(effect))}
    effects = tuple(effect for effect in whole.effects if effect.name not in left)
    if not any(effect.terms for effect in effects):
        raise InputError(
            f"the model's part for torsion has no effect that yields to a load: "
            f"{listed(left) or 'it is empty'}; fit a compliance, with --known-load"
        )
    if "gear_ratio" not in model.facts:
        raise InputError(
            "the model lacks the gear ratio, which relates both sides of the gear; fit it again "
            "with --gear-ratio"
        )
    ratio = float(gear_of(model.facts, motor_encoder=False)["effective_ratio"])
    sizes, first = [], 0
    for effect in whole.effects:
        last = first + len(effect.terms)
        if effect.name not in left:
            sizes.append(whole.coefficients[first:last])
        first = last
    ranges = whole.record.get("validity", {})
    here = ("channels", "prepared")  # of the log: encoders, a filter
    part = replace(
        whole,
        effects=effects,
        coefficients=np.concatenate(sizes),
        known_load="reference_torque",
        record={key: value for key, value in whole.record.items() if key not in here},
    )
    _require_braking(part)
    temperatures = read_temperatures(ranges)
    largest = _largest_load(effects, ranges, ratio)
    return Coupling(
        Model({PART_OF[part.target]: part}, model.facts),
        part,
        ratio,
        0.5 * sum(temperatures) if "temperature" in ranges else USUAL_TEMPERATURE,
        temperatures,
        largest,
        _least_compliance(model, part, ratio, largest, temperatures),
        left,
    )


def read_temperatures(ranges: Mapping[str, Sequence[float]]) -> tuple[float, float]:
    """Return between which temperatures [deg C] a model of these ranges is asked."""
    low, high = ranges.get("temperature", ANY_TEMPERATURE)
    return float(low), float(high)


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


def _require_braking(part: Part) -> None:
    """Refuse a loop that is run through the wrong way round."""
    first = 0
    for effect in part.effects:
        last = first + len(effect.terms)
        coefficients = part.coefficients[first:last]
        if effect.info.traits.dissipative and (coefficients < 0.0).any():
            worst = effect.terms[int(np.argmin(coefficients))].name
            raise InputError(
                f"{effect.name}.{worst} of the torsion is {coefficients.min():.3g} {part.unit}, by "
                "which each turn of its loop would give energy; leave the effect out, or record "
                "loads that rise and fall more often"
            )
        first = last


def _largest_load(
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


def _least_compliance(
    model: Model, part: Part, ratio: float, largest: float, temperatures: tuple[float, float]
) -> float:
    """How much the torsion grows with the load at least [rad/Nm], all of a loop sticking."""
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
    behind = np.array([0.0, REVERSED * largest])
    loads = np.linspace(-largest, largest, LOADS)
    least, mean, at = np.inf, 0.0, 0.0
    for temperature in warm:
        sticking = np.diff(torsions(behind, loops, temperature))[0] / behind[1]
        twisted = torsions(loads, ~loops, temperature)
        grows = -np.diff(twisted) / np.diff(loads) - sticking
        mean = max(mean, float(np.abs(twisted[-1] - twisted[0]) / (2.0 * largest)))
        if grows.min() < least:
            least, at = float(grows.min()), float(loads[int(np.argmin(grows))])
    if not least > RIGID * mean:
        raise InputError(
            f"the torsion of the model does not grow with the load at {at:.3g} Nm just behind a "
            f"reversal ({least:.3g} rad at the motor per Nm), so that no torque belongs to it; fit "
            "it with a mesh that gives way, and with a loop no larger than the runs determine"
        )
    return least
