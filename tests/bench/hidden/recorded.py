"""The runs of a case as a recorder saw them, and what is hidden in them at its size.

The noise in which a term is measured is what is left of the recorded target once the true base and
the true terms, fed with the recorded channels, are taken off: noise of the target, its quanta, the
load cell's noise with the other sign, and noise of the inputs times the true coefficients. It is
drawn by recording the runs again and again; its covariance is that of an autoregression, as if it
were the same in all rows. What all draws have in common (delays, slow thermistors) is no noise: it
is a column beside the base, as viscous friction that differs between directions is.

Of each input the better of two counts: the channel itself, or the one made of the position (of the
load, …) by a Gaussian without phase. No one would use a velocity that its position tells better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.ndimage import gaussian_filter1d

from flexspline.logs.log import Log
from hidden.cases import Case
from hidden.made import HELD_OUT, IN_TORSION, Made, base_of, forms_in, known_of, noise_of
from hidden.noise import NOISES, Noise
from hidden.recorder import FINE, MARGIN, Recorder, Taken, quantised, recorder_of, taken
from hidden.rig import EXCITATIONS, JOINTS, LOAD, Array, Scene, scene
from hidden.size import Size, Sizing, Term, sized

__all__ = ["DRAWS", "Unreachable", "recorded"]

DRAWS = 50  # of the recorder, over all runs that are fitted
ORDER = 30  # of the autoregression
REACH = 0.8  # of the largest t: no larger size is dealt
WIDTHS = (0.005, 0.01, 0.02, 0.04, 0.08)  # s, of the Gaussians
CLOSE = 0.01  # of a factor, at which it is solved
ROUNDS = 12
FAR = 1e4  # times its size: the noise is then that of the term's own inputs
NO_CHANNEL = {"motor_current": ("torque_constant_error", "temperature_dependent_friction")}


class Unreachable(Exception):
    """A size is above REACH of the largest t; `largest`: that t by name."""

    def __init__(self, largest: Mapping[str, float]) -> None:
        super().__init__(", ".join(f"{name}: {t:.3g}" for name, t in largest.items()))
        self.largest = dict(largest)


def recorded(case: Case) -> Made:
    """Make the runs of a case of the classes lab and robot.

    Raises
    ------
    Unreachable
        Where no size of the term has so large a t, or nearly none.
    """
    rig = _Rig(case)
    if not case.hidden and not case.unknown:
        return rig.made({}, rig.sizing(NOISES[case.noise], rig.level))
    return _solved(rig)


@dataclass(frozen=True)
class _Rig:
    """A case, its runs, and what is true in them."""

    case: Case

    @cached_property
    def runs(self) -> int:
        return EXCITATIONS[self.case.excitation]

    @cached_property
    def recorder(self) -> Recorder:
        return recorder_of(self.case, self.runs)

    @cached_property
    def amperes(self) -> float:
        """What a Nm at the output is in the target, where that is a current."""
        return 1.0 / JOINTS[self.case.joint].drive if self.case.target == "motor_current" else 1.0

    @cached_property
    def level(self) -> float:
        own = IN_TORSION if self.case.target == "torsion" else self.amperes
        return self.case.level * own

    @cached_property
    def fine(self) -> list[Scene]:
        case, seconds = self.case, self.recorder.seconds + 2.0 * MARGIN
        return [scene(JOINTS[case.joint], case.excitation, case.seed, k, rate=FINE, seconds=seconds)
                for k in range(self.runs + HELD_OUT)]  # fmt: skip

    def taken(self, number: int, draw: int = 0) -> Taken:
        late = self.recorder.load_delay if "sensor_lag" in self.case.hidden else 0.0
        seen = taken(self.recorder, self.fine[number], self.case.seed, number, draw,
                     load_at_sensor=late)  # fmt: skip
        return replace(seen, truth=self._carrying(seen.truth))

    def _carrying(self, s: Scene) -> Scene:
        """A robot carries its own link, whatever the load was."""
        if self.case.target != "motor_current":
            return s
        return replace(s, load=s.joint.link * np.sin(s.q - 0.3))

    @cached_property
    def first(self) -> list[Taken]:
        """Every run as it is in the log."""
        return [self.taken(k) for k in range(self.runs + HELD_OUT)]

    @cached_property
    def scenes(self) -> list[Scene]:
        return [seen.truth for seen in self.first]

    def known(self, s: Scene) -> Array:
        """The base in a scene, (N,)."""
        own = known_of(self.case, s)
        if self.case.target == "torsion":
            return own
        if "viscous_friction" not in self.case.hidden:
            own = own + s.joint.viscous * self._one_way(s)
        if self.case.target == "motor_current" and "gravity" not in self.case.hidden:
            own = own + s.load
        return self.amperes * own

    def _one_way(self, s: Scene) -> Array:
        return self.recorder.one_way * np.abs(s.v)

    def forms(self) -> dict[str, Callable[[Scene], Array]]:
        """What is hidden, with what differs between directions."""
        forms = dict(forms_in(self.case))
        if "viscous_friction" in forms:
            own = forms["viscous_friction"]
            forms["viscous_friction"] = lambda s: (
                own(s) * (1.0 + self.recorder.one_way * np.sign(s.v))
            )
        return forms

    @cached_property
    def exact(self) -> list[Log]:
        """Every run with exact channels and the base alone."""
        return [self.log(s, self.known(s), k) for k, s in enumerate(self.scenes)]

    def log(self, s: Scene, y: Array, number: int) -> Log:
        """Return a log of exact channels."""
        columns, ratio = s.columns, s.joint.ratio
        columns[LOAD] = self.amperes * s.transmitted if self.amperes != 1.0 else s.load
        target = {
            "sensor_torque": lambda: {"sensor_torque": y + s.load},
            "motor_torque": lambda: {"motor_torque": (y + s.load) / ratio},
            "motor_current": lambda: {"motor_current": y},
            "torsion": lambda: {"motor_position": ratio * s.q - y},
        }[self.case.target]()
        return Log.from_arrays(facts=self._facts(s, number), **{**columns, **target})

    def _facts(self, s: Scene, number: int) -> dict[str, str | float | int]:
        facts = {**s.joint.facts, "name": f"run{number + 1}"}
        if self.case.target == "motor_current":
            facts["torque_constant"] = s.joint.torque_constant
        return facts

    def recorded(self, seen: Taken, y: Array, number: int) -> Log:
        """Return the log of a run whose target is y with its noise, (N,)."""
        s, columns, ratio = seen.truth, dict(seen.columns), seen.truth.joint.ratio
        quanta = np.random.default_rng([20261122, self.case.seed, number, 2])
        if self.case.target == "sensor_torque":
            columns["sensor_torque"] = y + s.load
        elif self.case.target == "motor_torque":
            columns["motor_torque"] = (y + s.load) / ratio
        elif self.case.target == "motor_current":
            columns["motor_current"] = quantised(y, self.recorder.current_quantum, quanta)
        else:
            turned = ratio * s.q - y
            columns["motor_position"] = quantised(turned, self.recorder.motor_quantum, quanta)
        kept = {name: x[seen.kept] for name, x in {"time": seen.stamps, **columns}.items()}
        return Log.from_arrays(facts=self._facts(s, number), **kept)

    def disturbing(self) -> list[Array]:
        """What differs between directions, a column of each run that is fitted, (N, 1)."""
        own = self.scenes[: self.runs]
        wide = self.case.target != "torsion" and self.recorder.one_way != 0.0
        return [np.abs(s.v)[:, None] if wide else np.empty((len(s.v), 0)) for s in own]

    def sizing(self, noise: Noise, level: float, common: Sequence[Array] = ()) -> Sizing:
        """Return what measures terms in a noise beside the base and `common` columns, (N, K)."""
        case, columns = self.case, self.disturbing()
        if common:
            columns = [np.column_stack(both) for both in zip(columns, common, strict=True)]
        excluded = (*case.excluded, *NO_CHANNEL.get(case.target, ()))
        return Sizing(case.target, base_of(case), self.scenes[: self.runs],
                      self.exact[: self.runs], noise, level, excluded, columns)  # fmt: skip

    def made(self, sizes: Mapping[str, Size], sizing: Sizing) -> Made:
        """Return the runs with each term at its size."""
        case = self.case
        terms = {name: [sizes[name].factor * form(s) for s in self.scenes]
                 for name, form in self.forms().items()}  # fmt: skip
        clean = [self.known(s) + sum(term[k] for term in terms.values())
                 for k, s in enumerate(self.scenes)]  # fmt: skip
        measured = [y + noise_of(case, self.level, k, len(y)) for k, y in enumerate(clean)]
        logs = [self.recorded(seen, y, k)
                for k, (seen, y) in enumerate(zip(self.first, measured, strict=True))]  # fmt: skip
        exact = [self.log(s, y, k) for k, (s, y) in enumerate(zip(self.scenes, clean, strict=True))]
        return Made(
            base_of(case),
            tuple(self.scenes),
            tuple(logs[: self.runs]),
            tuple(exact[self.runs :]),
            terms,
            clean,
            measured,
            sizing,
            {name: one.t_base for name, one in sizes.items()},
            {name: one.closest for name, one in sizes.items()},
            recorder=self.recorder,
            unseen=tuple(logs[self.runs :]),
        )


def _solved(rig: _Rig) -> Made:
    """Solve for the factors: the noise that goes through a term grows with it."""
    case, errors = rig.case, _Errors.drawn(rig)
    raw = {name: [form(s) for s in rig.scenes] for name, form in rig.forms().items()}

    def sizes_at(
        factors: Mapping[str, float], *, alone: bool = False
    ) -> tuple[Sizing, dict[str, Size]]:
        noise, level, common = errors.noise(factors, alone=alone)
        sizing = rig.sizing(noise, level, common)
        return sizing, sized(sizing, raw, case.size)

    sizing, sizes = sizes_at({name: 0.0 for name in raw})
    small = {name: one.factor for name, one in sizes.items()}
    largest = {name: np.inf for name in raw}
    if errors.of_terms:
        far = {name: FAR * factor for name, factor in small.items()}
        beyond = sizes_at(far, alone=True)[1]
        largest = {name: case.size * far[name] / beyond[name].factor for name in raw}
        if min(largest.values()) < case.size / REACH:
            raise Unreachable(largest)
    factors = {name: factor / np.sqrt(1.0 - (case.size / largest[name]) ** 2)
               for name, factor in small.items()}  # fmt: skip
    for _ in range(ROUNDS):
        sizing, sizes = sizes_at(factors)
        moved = max(abs(sizes[name].factor / factors[name] - 1.0) for name in raw)
        factors = {name: one.factor for name, one in sizes.items()}
        if moved < CLOSE:
            return rig.made(sizes, sizing)
    raise Unreachable(largest)


@dataclass(frozen=True)
class _Errors:
    """What draws of the recorder add to the target of each run: (draws, N).

    `base`: target and inputs of the base; `terms`: inputs of each term, whose factor is one.
    """

    base: list[Array]
    terms: dict[str, list[Array]]

    @classmethod
    def drawn(cls, rig: _Rig) -> _Errors:
        forms, each = rig.forms(), DRAWS // rig.runs
        widths: dict[str, float | None] = {}
        base: list[Array] = []
        terms: dict[str, list[Array]] = {name: [] for name in forms}
        for k in range(rig.runs):
            own: dict[str, list[Array]] = {name: [] for name in ("", *forms)}
            for draw in range(1, each + 1):
                seen = rig.taken(k, draw)
                inputs = _read(rig, seen, widths)
                own[""].append(_of_target(rig, seen, k, draw)
                               - rig.known(inputs) + rig.known(seen.truth))  # fmt: skip
                for name, form in forms.items():
                    own[name].append(form(seen.truth) - form(inputs))
            base.append(np.array(own[""]))
            for name in forms:
                terms[name].append(np.array(own[name]))
        return cls(base, terms)

    @property
    def of_terms(self) -> bool:
        """Whether any term has inputs that are not exact."""
        return any(np.any(x) for runs in self.terms.values() for x in runs)

    def noise(
        self, factors: Mapping[str, float], *, alone: bool
    ) -> tuple[Noise, float, list[Array]]:
        """Return the noise with terms of these factors, its deviation, and what draws share.

        `alone`: without that of target and base.
        """
        whole = []
        for k, base in enumerate(self.base):
            own = sum((factors[name] * runs[k] for name, runs in self.terms.items()), 0.0 * base)
            whole.append(own if alone else own + base)
        common = [errors.mean(axis=0)[:, None] for errors in whole]
        about = [errors - mean.T for errors, mean in zip(whole, common, strict=True)]
        return *_autoregression(about), common


def _autoregression(errors: Sequence[Array]) -> tuple[Noise, float]:
    """The noise whose draws about their mean are given for each run, (draws, N)."""
    lags = np.zeros(ORDER + 1)
    for draws in errors:
        count, rows = draws.shape
        spectrum = np.abs(np.fft.rfft(draws, 2 * rows)) ** 2
        lags += np.fft.irfft(spectrum.sum(axis=0))[: ORDER + 1] / rows / (count - 1)
    lags /= len(errors)
    lags[0] *= 1.0 + 1e-9
    ahead = solve_toeplitz(lags[:-1], lags[1:])
    noise = Noise((1.0, *(-ahead).tolist()))
    innovation = float(np.sqrt(max(lags[0] - ahead @ lags[1:], 0.0)))
    return noise, innovation / noise.innovation(1.0)


def _of_target(rig: _Rig, seen: Taken, number: int, draw: int) -> Array:
    """Error of the recorded target of a draw, (N,)."""
    rows, columns = len(seen.stamps), seen.columns
    noise = noise_of(rig.case, rig.level, number, rows, draw)
    quanta = np.random.default_rng([20261122, rig.case.seed, number, draw, 3])
    grain = quanta.uniform(-0.5, 0.5, rows)
    if rig.case.target == "motor_current":
        return noise + rig.recorder.current_quantum * grain
    if rig.case.target == "torsion":
        q = seen.truth.joint.ratio * (columns["output_position"] - seen.truth.q)
        return noise + q + rig.recorder.motor_quantum * grain
    return noise - (columns[LOAD] - seen.truth.load)


CHANNELS = {"q": "output_position", "v": "output_velocity", "a": "output_acceleration",
            "load": LOAD, "temperature": "temperature", "motor_torque": "motor_torque"}  # fmt: skip
DERIVED = {"v": ("output_position", 1), "a": ("output_position", 2)}


def _read(rig: _Rig, seen: Taken, widths: dict[str, float | None]) -> Scene:
    """The scene as a recording tells it; `widths` of the Gaussians are chosen at the first."""
    s, made = seen.truth, {}
    for name, channel in CHANNELS.items():
        source, order = DERIVED.get(name, (channel, 0))
        if source not in seen.columns:
            continue
        truth = getattr(s, name)

        def told(width: float | None, channel: str = channel, source: str = source,
                 order: int = order) -> Array | None:  # fmt: skip
            if width is None:
                return seen.columns.get(channel)
            return _smooth(seen.stamps, seen.columns[source], width, order, s.rate)

        if name not in widths:
            tries = {width: told(width) for width in (None, *WIDTHS)}
            off = {width: float(np.mean((x - truth) ** 2))
                   for width, x in tries.items() if x is not None}  # fmt: skip
            widths[name] = min(off, key=lambda width: off[width])
        made[name] = told(widths[name])
    inputs = replace(s, **made)
    return rig._carrying(inputs)


def _smooth(stamps: Array, values: Array, width: float, order: int, rate: float) -> Array:
    """Values or a derivative behind a Gaussian without phase, at the same times."""
    even = stamps[0] + np.arange(len(stamps)) / rate
    x = np.interp(even, stamps, values)
    reach = min(int(4.0 * width * rate) + 1, len(x) - 1)
    ends = [2.0 * x[0] - x[reach:0:-1], x, 2.0 * x[-1] - x[-2 : -reach - 2 : -1]]
    smooth = gaussian_filter1d(np.concatenate(ends), width * rate, order=order)
    return np.interp(stamps, even, smooth[reach : reach + len(x)] * rate**order)
