"""How noisy a channel is: its quantum, its noise floor, and up to where its signal exceeds it.

The power spectral density of a recorded channel is that of its signal S(f), which falls steeply
(motions, loads and temperatures have a bandwidth), and that of what the recorder adds, N, which is
flat: quantisation of a signal that moves over many steps [Widrow1956] and electronic noise. N is
the level of the highest octave, and no less than a quantum Q leaves, Q²/12 over the whole band:
where a joint stands or moves evenly the error of its encoder is no noise but a few lines, between
which, and so in the median over an octave, there is less than in the motion that a model learns
from. A torque or a current that steps from one row to the next, such as that of a brake or of
friction that turns over, has a signal in that octave, too: N is that of the short pieces without
such a step. No angle, speed or temperature steps. The bandwidth is the highest frequency with
S > N: below it the channel speaks, above it only its noise does. The best smoother for a derivative
of order k is the one whose response G loses and lets pass the least,

    ∫ (2πf)^2k [(1 − G)² S + G² N] df,

which is where a Wiener filter, S / (S + N), would end too.

A derivative that noise and rounding make all of is no regressor: what the recording lets one expect
of it is zero. Behind a smoother with -3 dB at B white noise of RMS n at a period T becomes, in the
derivative of order k,

    n² 2 T (2π)^2k I_k B^(2k+1),    I_k = ∫ f^2k G² df of B = 1 Hz

and its mean square over t seconds has 2 t B c_k degrees of freedom, c_k = I_k² / ∫ f^4k G⁴ df.
Quantisation of a slow or an even motion is not white: whatever its spectrum, an error of RMS e
becomes no more than e · max (2πf)^k G = e m_k B^k.

Spectra are averaged over segments [Welch1967] of the second differences, whose own spectrum is
flat enough for no leakage to hide the floor, and divided by the gain of these differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.channels import CHANNELS
from flexspline.logs.local_fit import WIDEST, LocalFit, response
from flexspline.logs.log import Log
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.segments import median_step, runs

__all__ = ["ChannelNoise", "channel_noise", "is_only_noise"]

Array = NDArray[np.float64]

SECONDS = 4.0  # of a segment: it resolves a quarter of a hertz, far below any bandwidth sought
PARTS, PART = 8, 50_000  # of a long run, and rows of each, that are looked at
SHORTEST = 128  # rows of a run that is looked at: in shorter ones leakage passes for noise
DIFFERENCES = 2
PIECE = 64  # rows of a short piece: 16 frequencies in the highest octave
STEPS = 0.5  # of the squared changes within a piece, that one change has which is not undone at
# once: of 63 changes by noise the largest has a sixth; and what of it the row beside may undo
STEPPING = ("Nm", "A")  # units of channels that may step
LEAST = 3.0  # quanta of a step: a slow signal goes by one
KEPT = 0.25  # of the pieces, that have to be without a step
BESIDE = 3  # neighbours in frequency that exceed the floor together: one alone is chance
EVEN = 1e-3  # of a step, by which times may be off to count as even
HIGHEST, WIDTHS = 0.24, 60  # of the rate, what a smoother of a few rows can do; how many are tried
PASSED = {1: (0.48118, 1.3331, 4.4526), 2: (0.55392, 1.2815, 30.762)}  # I_k, c_k, m_k, by k
WINDOWS = 8.0  # half lengths of a smoother, about, in the longest run: wider ones see no change
SIGNIFICANT = 3.0  # standard errors of a mean square, from which it is more than noise
ROUNDED = 1e-12  # of a channel's size: 40 bits, which no instrument has; a smoother rounds by less
OFF_LATTICE = 0.05  # of a step, as `quantum` takes it
NEGLIGIBLE = 1e-7  # noise over the spread of a channel: what a file of eight digits has itself


@dataclass(frozen=True)
class ChannelNoise:
    """What a recorder added to one channel of some runs, in the unit of the channel.

    Parameters
    ----------
    channel : its name.
    quantum : step of its quantisation, 0 where none is seen.
    noise : RMS of the noise floor over the whole band.
    bandwidth : Hz, highest frequency at which the signal exceeds the floor.
    rate : Hz, of the runs; the slowest of them.
    spread : RMS of the channel around its mean.
    density : power spectral density S + N (F,), unit²/Hz, at `frequencies` (F,), Hz.
    delay : s, by which it is later than the channel that it is compared with; 0 where it was not.
    """

    channel: str
    quantum: float
    noise: float
    bandwidth: float
    rate: float
    spread: float
    frequencies: Array = field(repr=False, compare=False)
    density: Array = field(repr=False, compare=False)
    delay: float = 0.0

    @property
    def noisy(self) -> bool:
        """Whether there is a band in which the channel carries noise alone, more than rounding."""
        return self.bandwidth < 0.25 * self.rate and self.noise > NEGLIGIBLE * self.spread

    @property
    def coarse(self) -> bool:
        """Whether the signal has frequencies beyond those that a smoother can keep."""
        return self.bandwidth >= 0.25 * self.rate and self.noise > NEGLIGIBLE * self.spread

    @property
    def slope(self) -> float:
        """RMS of how fast the signal changes, unit / s."""
        floor = 2.0 * self.noise**2 / self.rate
        signal = np.where(self.frequencies <= self.bandwidth, self.density - floor, 0.0)
        weight = (2.0 * np.pi * self.frequencies) ** 2 * np.gradient(self.frequencies)
        return float(np.sqrt(np.maximum(signal, 0.0) @ weight))

    def within(self, bandwidth: float, derivative: int = 0) -> float:
        """RMS of the noise below `bandwidth` [Hz] in a derivative of the channel, unit / s^k."""
        order = 2 * derivative + 1
        density = 2.0 * self.noise**2 / self.rate
        slope = (2.0 * np.pi) ** derivative
        return float(slope * np.sqrt(density * bandwidth**order / order))

    def smoother(self, derivative: int = 0) -> float:
        """-3 dB [Hz] of the smoother that tells a derivative of the channel best."""
        floor = 2.0 * self.noise**2 / self.rate
        excess = np.maximum(self.density - floor, 0.0)
        signal = np.where(self.frequencies <= self.bandwidth, excess, 0.0)
        weight = self.frequencies ** (2 * derivative) * np.gradient(self.frequencies)
        widths = np.geomspace(self.frequencies[0], HIGHEST * self.rate, WIDTHS)
        gains = response(self.frequencies, widths[:, None])
        errors = ((1.0 - gains) ** 2 * signal + gains**2 * floor) @ weight
        return float(f"{widths[np.argmin(errors)]:.6g}")


def channel_noise(logs: Sequence[Log], channel: str) -> ChannelNoise | None:
    """Return the noise of a channel over all runs, None where no run is long enough to tell.

    Parameters
    ----------
    logs : runs that all have the channel, of finite values; time strictly increasing.
    """
    from scipy.ndimage import minimum_filter1d

    rate = min(log.rate for log in logs)
    frequencies = np.geomspace(2.0 / SECONDS, 0.45 * rate, 80)
    found = [one for log in logs for one in _told(log, channel, rate, frequencies)]
    if not found:
        return None
    weights, densities, floors = zip(*found, strict=True)
    density = np.average(densities, axis=0, weights=weights)
    step = max(quantum(log[channel]) for log in logs)
    octave = frequencies > 0.5 * frequencies[-1]
    highest = float(np.median(density[octave]))
    if np.isfinite(floors).any():
        own = [min(one, np.median(d[octave])) for one, d in zip(floors, densities, strict=True)]
        highest = min(highest, float(np.average(own, weights=weights)))
    floor = max(highest, step**2 / (6.0 * rate))
    exceeds = minimum_filter1d((density > 2.0 * floor).astype(int), BESIDE, mode="nearest")
    above = np.flatnonzero(exceeds)
    bandwidth = float(frequencies[above[-1]] if above.size else frequencies[0])
    return ChannelNoise(
        channel,
        step,
        float(np.sqrt(0.5 * floor * rate)),
        bandwidth,
        rate,
        float(np.sqrt(np.mean([np.var(log[channel]) for log in logs]))),
        frequencies,
        density,
    )


def _told(
    log: Log, channel: str, rate: float, frequencies: Array
) -> list[tuple[int, Array, float]]:
    """Rows, density and floor of each run that is long enough to tell, made once for a log.

    The floor is that without steps, infinite where there is none.
    """
    kept = _KEPT.setdefault(log, {})
    if (channel, rate) not in kept:
        time, values = log["time"], log[channel]
        least = LEAST * quantum(values) if CHANNELS[channel].unit in STEPPING else np.inf
        made = kept[channel, rate] = []
        for first, last in runs(time):
            if last - first >= SHORTEST and 0.45 * rate > 4 * DIFFERENCES / SECONDS:
                parts = [_density(time[a:b], values[a:b], frequencies, least)
                         for a, b in _looked_at(first, last)]  # fmt: skip
                densities, floors = zip(*parts, strict=True)
                made.append((last - first, np.mean(densities, axis=0), float(np.mean(floors))))
    return kept[channel, rate]


_KEPT: WeakKeyDictionary[Log, dict[tuple[str, float], list[tuple[int, Array, float]]]] = (
    WeakKeyDictionary()
)


def _looked_at(first: int, last: int) -> list[tuple[int, int]]:
    """All rows of a run [first, last), or parts that lie evenly over a long one."""
    if last - first <= PARTS * PART:
        return [(first, last)]
    starts = np.linspace(first, last - PART, PARTS).astype(int)
    return [(int(start), int(start) + PART) for start in starts]


def _density(time: Array, values: Array, frequencies: Array, least: float) -> tuple[Array, float]:
    """Power spectral density of an unbroken run at frequencies [Hz], unit²/Hz; local medians.

    Behind it that of the highest octave beside steps of more than `least`, infinite without steps.
    """
    from scipy.interpolate import make_interp_spline
    from scipy.signal import welch

    step = median_step(time)
    if np.max(np.abs(np.diff(time) - step)) > EVEN * step:
        even = np.arange(time[0], time[-1], step)
        values = np.asarray(make_interp_spline(time, values, k=3)(even))
    rough = np.diff(values, n=DIFFERENCES)
    length = min(len(rough), round(SECONDS / step))
    at, raw = welch(rough, 1.0 / step, "blackmanharris", length, detrend=_without_line)
    raw = raw[1:] / (2.0 * np.sin(np.pi * at[1:] * step)) ** (2 * DIFFERENCES)
    edges = np.searchsorted(at[1:], np.outer([1.0 / 1.25, 1.25], frequencies))
    middles = [_middle(raw[min(a, len(raw) - 1) : max(b, a + 1)]) for a, b in edges.T]
    return np.array(middles), _beside_steps(values, step, float(frequencies[-1]), least)


def _beside_steps(values: Array, period: float, highest: float, least: float) -> float:
    """Density in the octave below `highest` [Hz] of the pieces in which no value steps."""
    pieces = values[: len(values) // PIECE * PIECE].reshape(-1, PIECE)
    change = np.diff(pieces, axis=1)
    change -= np.median(change, axis=1, keepdims=True)
    at = np.argmax(np.abs(change), axis=1)[:, None]
    largest = np.take_along_axis(change, at, axis=1)[:, 0]
    around = np.pad(change, ((0, 0), (1, 1)))
    undone = [np.take_along_axis(around, at + k, axis=1)[:, 0] for k in (0, 2)]
    stays = np.min(np.abs(largest + np.array(undone)), axis=0) > STEPS * np.abs(largest)
    alone = largest**2 > STEPS * np.sum(change**2, axis=1)
    calm = ~(stays & alone & (np.abs(largest) > least))
    if calm.all() or np.mean(calm) < KEPT:
        return np.inf
    rough = np.diff(pieces[calm], n=DIFFERENCES, axis=1)
    frequency = np.fft.rfftfreq(rough.shape[1], period)
    octave = (frequency > 0.5 * highest) & (frequency <= highest)
    window = np.hanning(rough.shape[1])
    power = np.abs(np.fft.rfft(rough * window, axis=1)[:, octave]) ** 2
    gain = (2.0 * np.sin(np.pi * frequency[octave] * period)) ** (2 * DIFFERENCES)
    return float(2.0 * period / (window @ window) * np.mean(power / gain))


def _without_line(values: Array) -> Array:
    """Values (..., N) less the straight line through them; SciPy's takes four times as long."""
    t = np.arange(values.shape[-1]) - 0.5 * (values.shape[-1] - 1)
    tilt = (values @ t / (t @ t))[..., None] * t
    return np.asarray(values - np.mean(values, axis=-1, keepdims=True) - tilt)


def _middle(values: Array) -> float:
    """Median of finite values: NumPy's takes ten times as long for so few."""
    ordered = np.sort(values)
    return float(0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]))


def is_only_noise(log: Log, channel: str, derivative: int) -> bool:
    """Whether noise and rounding of a channel make all of its derivative, whatever the smoother.

    False where the log is too short to tell, or the channel is not finite.

    Parameters
    ----------
    derivative : 1 or 2.
    """
    time, values = log["time"], log[channel]
    pieces = [slice(first, last) for first, last in runs(time) if last - first >= SHORTEST]
    if not pieces or not np.isfinite(values).all():
        return False
    step = median_step(time)
    noise, error = white_noise(values), _rounding(values)
    passed, freedom, most = PASSED[derivative]
    width = WINDOWS / max(float(time[piece][-1] - time[piece][0]) for piece in pieces)
    looked_at = False
    while width <= WIDEST / step:
        rows = _away_from_ends(LocalFit(width, derivative), time, values, pieces)
        if len(rows):
            chance = SIGNIFICANT / np.sqrt(len(rows) * step * width * freedom)  # √(2 / freedom)
            of_noise = noise**2 * 2.0 * step * passed * width
            of_noise *= (2.0 * np.pi * width) ** (2 * derivative) * (1.0 + chance)
            of_rounding = (error * most * width**derivative) ** 2
            if float(np.mean(rows**2)) > of_noise + of_rounding:
                return False
            looked_at = True
        width *= 2.0
    return looked_at


def _rounding(values: Array) -> float:
    """RMS by which finite values are rounded: to steps, to a float of 32 bits, or to a double."""
    size = float(np.max(np.abs(values)))
    single = values.astype(np.float32)
    step = float(np.spacing(np.float32(size))) if np.array_equal(single, values) else 0.0
    step = max(step, quantum(values), _step_of_bends(values, ROUNDED * size))
    return max(step / float(np.sqrt(12.0)), ROUNDED * size)


def _step_of_bends(values: Array, least: float) -> float:
    """Step of which all second differences above `least` are multiples; 0 where there is none.

    An even motion goes by steps that differ by one quantum and are many, from which its levels do
    not tell the quantum. An acceleration that is even passes for one too, of a T²: that is 9 (B T)²
    times itself behind a smoother, which is nothing.
    """
    bends = np.abs(np.diff(values, n=2))
    bends = bends[bends > least]
    if not len(bends):
        return 0.0
    step = float(np.mean(bends[bends < 1.5 * np.percentile(bends, 5)]))
    off = np.abs(bends / step - np.round(bends / step))
    return step if float(np.percentile(off, 98)) < OFF_LATTICE else 0.0


def _away_from_ends(fit: LocalFit, time: Array, values: Array, pieces: Sequence[slice]) -> Array:
    """A derivative where the smoother sees both sides, (N,), of all pieces one behind the other."""
    found = [np.empty(0)]
    for piece in pieces:
        at = time[piece]
        inside = (at - at[0] >= fit.half_length) & (at[-1] - at >= fit.half_length)
        if inside.any():
            found.append(fit.apply(at, values[piece])[inside])
    return np.concatenate(found)
