"""The noise of a recorded case: what draws of the recorder do to target and rows.

What is left of the recorded target once the true base and the true terms, fed with the recorded
channels, are taken off: noise of the target, its quanta, the load cell's noise with the other sign,
and noise of the inputs times the true coefficients. Its covariance is that of an autoregression, as
if it were the same in all rows. What all draws have in common (delays, a slow thermistor) is no
noise; it is returned beside it.

Of each input the better of two counts: the channel itself, or the one made of the position (of the
load, …) by a Gaussian without phase. No one would use a velocity that its position tells better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.ndimage import gaussian_filter1d

from hidden.made import noise_of
from hidden.noise import Noise
from hidden.recorder import Taken
from hidden.rig import LOAD, Array, Scene

if TYPE_CHECKING:
    from hidden.recorded import Rig

__all__ = ["DRAWS", "RowNoise", "inputs_of"]

DRAWS = 50  # of the recorder, over all runs that are fitted
ORDER = 30  # of the autoregression
WIDTHS = (0.005, 0.01, 0.02, 0.04, 0.08)  # s, of the Gaussians
ENDS = 4.0  # widths of a Gaussian that are looked at
RIDGE = 1e-9  # of the variance, so that noise without power at a frequency can be inverted

Widths = dict[str, float | None]
"""Of the Gaussian for each input; None: the channel as it is."""

CHANNELS = {
    "q": "output_position",
    "v": "output_velocity",
    "a": "output_acceleration",
    "load": LOAD,
    "temperature": "temperature",
    "motor_torque": "motor_torque",
}
"""Of each input of a scene."""
DERIVED = {"v": ("output_position", 1), "a": ("output_position", 2)}
"""What an input may be made of, and by which derivative; the others are made of themselves."""


@dataclass(frozen=True)
class RowNoise:
    """What draws of the recorder add to the target of each run: (draws, N).

    `base`: by the target and the inputs of the base; `terms`: by the inputs of each term, whose
    factor is one.
    """

    base: list[Array]
    terms: dict[str, list[Array]]

    @classmethod
    def drawn(cls, rig: Rig, draws: Sequence[int] | None = None) -> RowNoise:
        """Record the runs that are fitted again and again, DRAWS times in all or in these draws."""
        numbers = range(1, DRAWS // rig.runs + 1) if draws is None else draws
        forms, widths = rig.forms(), Widths()
        base: list[Array] = []
        terms: dict[str, list[Array]] = {name: [] for name in forms}
        for k in range(rig.runs):
            seen = [rig.taken(k, draw) for draw in numbers]
            read = [inputs_of(rig, one, widths) for one in seen]
            truth = seen[0].truth
            targets = [_of_target(rig, one, k, draw)
                       for draw, one in zip(numbers, seen, strict=True)]  # fmt: skip
            known = rig.known(truth) - [rig.known(inputs) for inputs in read]
            base.append(np.array(targets) + known)
            for name, form in forms.items():
                terms[name].append(np.array([form(truth) - form(inputs) for inputs in read]))
        return cls(base, terms)

    @property
    def of_terms(self) -> bool:
        """Whether any term has inputs that are not exact."""
        return any(np.any(x) for runs in self.terms.values() for x in runs)

    def at(
        self, factors: Mapping[str, float], *, alone: bool = False
    ) -> tuple[Noise, float, list[Array]]:
        """Return the noise with terms of these factors, its deviation, and what draws share.

        `alone`: without that of target and base. What they share: (N, 1) of each run.
        """
        whole = []
        for k, base in enumerate(self.base):
            own = sum((factors[name] * runs[k] for name, runs in self.terms.items()), 0.0 * base)
            whole.append(own if alone else own + base)
        common = [errors.mean(axis=0) for errors in whole]
        about = [errors - mean for errors, mean in zip(whole, common, strict=True)]
        return *_autoregression(about), [mean[:, None] for mean in common]


def _autoregression(errors: Sequence[Array]) -> tuple[Noise, float]:
    """The noise, and its deviation, whose draws about their mean are given for each run."""
    lags = np.zeros(ORDER + 1)
    for draws in errors:
        count, rows = draws.shape
        spectrum = np.abs(np.fft.rfft(draws, 2 * rows)) ** 2
        lags += np.fft.irfft(spectrum.sum(axis=0))[: ORDER + 1] / rows / (count - 1)
    lags /= len(errors)
    lags[0] *= 1.0 + RIDGE
    ahead = solve_toeplitz(lags[:-1], lags[1:])
    noise = Noise((1.0, *(-ahead).tolist()))
    innovation = float(np.sqrt(max(lags[0] - ahead @ lags[1:], RIDGE * lags[0])))
    return noise, innovation / noise.innovation(1.0)


def _of_target(rig: Rig, seen: Taken, number: int, draw: int) -> Array:
    """Error of the recorded target of a draw, (N,)."""
    rows, columns = len(seen.stamps), seen.columns
    noise = noise_of(rig.case, rig.level, number, rows, draw)
    quanta = np.random.default_rng([20261122, rig.case.seed, number, draw, 3])
    grain = quanta.uniform(-0.5, 0.5, rows)
    if rig.case.target == "motor_current":
        return noise + rig.recorder.current_quantum * grain
    if rig.case.target == "torsion":
        turned = seen.truth.joint.ratio * (columns["output_position"] - seen.truth.q)
        return np.asarray(noise + turned + rig.recorder.motor_quantum * grain)
    return np.asarray(noise - (columns[LOAD] - seen.truth.load))


def inputs_of(rig: Rig, seen: Taken, widths: Widths) -> Scene:
    """Return the scene as a recording tells it; `widths` that are missing are chosen by it."""
    s, made = seen.truth, dict[str, Array]()
    for name, channel in CHANNELS.items():
        source, order = DERIVED.get(name, (channel, 0))
        if source not in seen.columns:
            continue
        if name not in widths:
            widths[name] = _best(seen, getattr(s, name), channel, source, order)
        made[name] = _told(seen, channel, source, order, widths[name])
    return rig.carrying(replace(s, **made))


def _best(seen: Taken, truth: Array, channel: str, source: str, order: int) -> float | None:
    """The width that comes nearest to the truth."""
    tries: list[float | None] = [*([None] if channel in seen.columns else []), *WIDTHS]
    off = [np.mean((_told(seen, channel, source, order, width) - truth) ** 2) for width in tries]
    return tries[int(np.argmin(off))]


def _told(seen: Taken, channel: str, source: str, order: int, width: float | None) -> Array:
    if width is None:
        return seen.columns[channel]
    return _smooth(seen.stamps, seen.columns[source], width, order, seen.truth.rate)


def _smooth(stamps: Array, values: Array, width: float, order: int, rate: float) -> Array:
    """Values or a derivative behind a Gaussian without phase, at the same times."""
    even = stamps[0] + np.arange(len(stamps)) / rate
    x = np.interp(even, stamps, values)
    reach = min(int(ENDS * width * rate) + 1, len(x) - 1)
    ends = [2.0 * x[0] - x[reach:0:-1], x, 2.0 * x[-1] - x[-2 : -reach - 2 : -1]]
    smooth = gaussian_filter1d(np.concatenate(ends), width * rate, truncate=ENDS)
    for _ in range(order):  # kernels of derivatives that are cut off let a constant through
        smooth = np.gradient(smooth, 1.0 / rate)
    return np.interp(stamps, even, smooth[reach : reach + len(x)])
