"""The result of a comparison: printed, drawn, and as plain data.

`comparison.json` holds the same numbers for scripts, by the contract of the command line. Two
sentences state where measurement and model disagree most, not why: they name no cause.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from flexspline.about import __version__
from flexspline.comparison.runs import Compared, ComparedRun
from flexspline.comparison.search import (
    ALPHA,
    ORDERS,
    Analysis,
    Band,
    OrderPeak,
    Place,
    Step,
    bands_of,
    overall,
    peaks_of,
    place_of,
    worst_band,
)
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.formatting import told_apart
from flexspline.lazy import Rendered, render
from flexspline.prepared import bandwidth_used, inputs_json
from flexspline.schema import checked_json

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.orders import OrderAnalysis
    from flexspline.prepared import Preparation

__all__ = [
    "Comparison",
    "Remembered",
    "assembled",
    "floor_sentence",
    "legible",
    "ranked",
    "sentences",
    "sized",
]

TURNS = "what turns with the joint"
_ONCE = {"reversal_angle": "distance from reversals"}
_ONCE["reversal_time"] = _ONCE["reversal_angle"]

WORTH_SAYING = 0.1  # of what all explain together
MOST = 3
NOTHING = "No channel locates any of it."
FEW = 16
"""Independent rows of a band, of which fewer do not show a mean as large as their whole spread at a
level of one in a thousand: Student's t exceeds the root of their number there."""
MOST_IDLE = 7
FAR = 2.0  # times the floor: a simulation that is off by more is not down at it
UNEVEN = 2.0  # times that of half of the rows: the floor is then that of a few. At 1 the sentence
# stands in every comparison; at 4 it is missing where a step at reversals doubles the floor

_NOUNS = {
    "load": "at loads ",
    "motor_temperature": "at motor temperatures ",
    "position": "at output angles ",
    "acceleration": "at accelerations ",
    "time": "at times ",
}
_BESIDE = {"speed": "at speeds ", "temperature": "at temperatures "}
"""Of what its unit tells where it stands alone."""
_AFTER = ("reversal_angle", "reversal_time")

FORMAT = "flexspline-comparison"
VERSION = 1
ALWAYS = ("run", "speed", "direction", "position_order", "temperature", "load")
REVERSAL = ("reversal_time", "reversal_angle")


@dataclass(frozen=True)
class Follows:
    """One thing that the residual follows, the most telling first.

    `name`: key of `Comparison.by`; `words` for it in sentences. `gain`: mean square that it
    explains once those before it are taken out, squared unit; `share` of the gap's square above
    the floor. `chance`: that noise alone does so. `also`: what would explain nearly as much.
    `place`: where on its axis it is large; None for orders of what turns.
    """

    name: str
    words: str
    gain: float
    share: float
    chance: float
    also: tuple[str, ...]
    place: Place | None


@dataclass(frozen=True)
class Remembered:
    """The noise's memory: order of the model, seconds; and the velocity's noise, rad/s."""

    order: int
    seconds: float
    innovation: float
    velocity: float
    velocity_matters: bool


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Rendered):
    """Where a model and runs disagree. Numbers in `unit`.

    Parameters
    ----------
    what : the target, or the channel of a simulation that is compared.
    unit : of measured, modelled and all errors.
    simulated : by forward simulation, else by prediction.
    lowpass : Hz, or None.
    runs : measured and modelled values, row by row.
    overall : all rows.
    by : bands of "run", "direction", "speed", "load", "temperature", "position",
        "acceleration", "reversal_angle", "reversal_time", "time", as far as there are channels.
    units, words : of the names in `by`.
    orders : of what turns that the residual holds, the largest first.
    follows : what the residual follows, the most telling first; empty at the noise floor.
    makes_no_difference : in words, what it does not follow.
    memory : of the noise.
    load_source : where the load is from, "" where it is not known.
    spectrum : of the residual over the output's orders, or None where it does not turn.
    foreign : the foreign simulation that is the base, in words; "" without one.
    notes : sentences on the base: rows of which it says nothing, delays, and of a model what
        `predict` warns of.
    inputs : noise of each channel of the runs; of a prediction.
    preparations : how channels were made before the model read them.
    bandwidth : Hz, of the output's motion, as it was asked for; None: as model or runs tell.
    speed_above : rad/s of the output, below which rows were left out; None for none.
    """

    _kind: ClassVar = "comparison"

    what: str
    unit: str
    simulated: bool
    lowpass: float | None
    runs: tuple[ComparedRun, ...]
    overall: Band
    by: Mapping[str, tuple[Band, ...]]
    units: Mapping[str, str]
    words: Mapping[str, str]
    orders: tuple[OrderPeak, ...]
    follows: tuple[Follows, ...]
    makes_no_difference: tuple[str, ...]
    memory: Remembered
    load_source: str
    spectrum: OrderAnalysis | None
    facts: Mapping[str, Any]
    foreign: str = ""
    notes: tuple[str, ...] = ()
    inputs: tuple[ChannelNoise, ...] = ()
    preparations: tuple[Preparation, ...] = ()
    bandwidth: float | None = None
    speed_above: float | None = None

    @property
    def rmse(self) -> float:
        """Root mean square of measured less modelled."""
        return self.overall.rmse

    @property
    def noise_floor(self) -> float:
        """RMS of what no channel explains."""
        return self.overall.noise_floor

    @property
    def is_short(self) -> bool:
        """Whether bands have too few independent rows to show one that is off by all of the gap."""
        return self.overall.effective_rows < FEW * _most_bands(self)

    @property
    def excess(self) -> float:
        """RMS of the gap above the noise floor."""
        return self.overall.excess

    @cached_property
    def sentences(self) -> tuple[str, str]:
        """How large the gap is, and where."""

        return sentences(self)

    def __getitem__(self, name: str) -> tuple[Band, ...]:
        """Return the bands of one covariate, such as "speed"."""
        if name not in self.by:
            raise InputError(
                f"the comparison has no '{name}'{did_you_mean(name, self.by)}; it has "
                f"{listed(self.by)}"
            )
        return self.by[name]

    def to_frame(self) -> pandas.DataFrame:
        """Return all bands as a table, by covariate and label."""
        from dataclasses import asdict

        import pandas

        rows = [{"covariate": "all", **asdict(self.overall)}]
        rows += [{"covariate": name, **asdict(b)} for name, bands in self.by.items() for b in bands]
        return pandas.DataFrame(rows).set_index(["covariate", "label"])

    def to_json(self) -> str:
        """Return the text of `comparison.json`."""

        return comparison_json(self)

    def __repr__(self) -> str:
        return (
            f"<Comparison of {self.what}: {len(self.runs)} runs, RMSE {self.rmse:.4g} {self.unit}, "
            f"noise floor {self.noise_floor:.4g} {self.unit}>"
        )

    def plot(self) -> Figure:
        """Return the map: excess over the floor against each covariate, the worst first."""
        return render("comparison", "figure", self)


def ranked(made: Comparison) -> list[str]:
    """Return the names of `made.by`, what the gap follows first, then by their worst band."""
    first = [f.name for f in made.follows if f.name in made.by]
    rest = [name for name in made.by if name not in first]
    return [*first, *sorted(rest, key=lambda name: -worst_band(made.by[name]).excess)]


def assembled(compared: Compared, made: Analysis, facts: Mapping[str, Any]) -> Comparison:
    """Return the result."""
    shown = [covariate for covariate in made.covariates if covariate.shown]
    parts = made.rows, made.memory, made.found, made.test
    family = max(len(made.found.chances), 1)
    whole = overall(*parts)
    by = {c.name: tuple(bands_of(c, *parts, family)) for c in shown}
    turns = made.spectrum.analysis
    return Comparison(
        compared.what,
        compared.unit,
        compared.simulated,
        compared.lowpass,
        compared.runs,
        whole,
        by,
        {c.name: c.unit for c in shown},
        {c.name: c.words for c in shown},
        tuple(peaks_of(made.turning)),
        tuple(_follows(step, made, whole) for step in made.found.steps),
        _idle(made),
        _remembered(compared, made),
        compared.load_source,
        turns,
        dict(facts),
        compared.foreign,
        compared.notes,
        compared.inputs,
        compared.preparations,
        compared.bandwidth,
        compared.speed_above,
    )


def _follows(step: Step, made: Analysis, whole: Band) -> Follows:
    place = None
    words = TURNS
    if step.covariate is not None:
        place = place_of(step, made.test(step.covariate, made.found.rest))
        words = step.covariate.words
    names = {c.name: _ONCE.get(c.name, c.words) for c in made.covariates} | {ORDERS: TURNS}
    also = tuple(dict.fromkeys(names[n] for n in step.also if names[n] != names[step.name]))
    share = step.gain / whole.excess**2 if whole.excess > 0.0 else 0.0
    return Follows(step.name, words, step.gain, share, step.chance, also, place)


def _idle(made: Analysis) -> tuple[str, ...]:
    """What the residual does not follow, in words."""
    steps = made.found.steps
    busy = {step.name for step in steps} | {name for step in steps for name in step.also}
    level = ALPHA / max(len(made.found.chances), 1)
    busy |= {name for name, chance in made.found.chances.items() if chance < level}
    if "reversal_angle" in busy or "reversal_time" in busy:
        busy |= {"reversal_angle", "reversal_time"}
    busy |= {part for name in busy for part in name.split(" and ")}
    idle = [_ONCE.get(c.name, c.words) for c in made.covariates if c.shown and c.name not in busy]
    if made.spectrum.analysis is not None and ORDERS not in busy and not made.turning.found:
        idle.append(TURNS)
    return tuple(dict.fromkeys(idle))


def _remembered(compared: Compared, made: Analysis) -> Remembered:
    noise = made.memory.model
    velocity = max(run.velocity_noise for run in compared.runs)
    matters = float(np.mean(made.rows.doubt**2)) > 0.01 * made.found.floor_square
    matters = matters or bool(made.rows.allowance.max() > made.found.floor_square**0.5)
    return Remembered(
        noise.order,
        float(noise.memory * noise.decimation * made.step),
        float(noise.innovation_variance**0.5),
        float(velocity),
        bool(matters),
    )


def sentences(made: Comparison, *, of_bands_alone: bool = True) -> tuple[str, str]:
    """Return the size of the gap beside the floor, and where the gap is.

    `of_bands_alone`: whether nothing but bands was asked, so that it counts where they are short.
    """
    whole, what = made.overall, made.what.replace("_", " ")
    size = legible(whole.rmse, whole.noise_floor)
    floor = sized(whole.noise_floor, whole.noise_floor)
    kind = "simulated" if made.simulated or made.foreign else "predicted"
    of = f"between measured and {kind} {what}"
    if made.simulated and not made.follows and made.rmse > FAR * made.noise_floor:
        first = f"The gap {of} is {size} {made.unit} RMS; the measured one resolves {floor}."
        return first, "No channel locates it: it grows and shrinks with time, as drift does."
    first = f"The gap {of} is {size} {made.unit} RMS"
    short = _too_short(made) if of_bands_alone else ""
    if not made.follows:
        idle = _and(made.makes_no_difference[:MOST_IDLE], "or")
        unseen = f"Nothing in it is seen to follow {idle}." if idle else NOTHING
        if short:
            return f"{first}, and is noise or something slow.", f"{unseen} {short}"
        return f"{first}, which is down at the noise floor.", unseen
    first += f" against a noise floor of {floor} {made.unit}."
    return first, f"{_where(made)} The floor is at most that. {short}" if short else _where(made)


def _most_bands(made: Comparison) -> int:
    return max((len(each) for each in made.by.values()), default=1)


def _too_short(made: Comparison) -> str:
    """Say where bands have too few independent rows to show that they are off."""
    if not made.is_short:
        return ""
    bands = _most_bands(made)
    rows, independent = made.overall.rows, made.overall.effective_rows
    return (
        f"With the memory that it has {rows} rows are worth {independent:.0f} independent ones, "
        f"too few in each of {bands} bands to show one that is off: record longer runs, or ask "
        "discover, which tries effects and smooth functions."
    )


def floor_sentence(made: Comparison) -> str:
    """Say how the noise floor was estimated."""
    if made.simulated and made.what == "output_position":
        return (
            "The noise floor is that of the measured angle alone: its white noise, or its counts. "
            "A simulation is off by more wherever it drifts."
        )
    noise = made.memory
    seconds = f"{noise.seconds:.2g} s" if noise.seconds >= 1e-4 else "less than a row"
    taken = [f.words for f in made.follows]
    left = (
        f"what is left of the residual once its dependence on {_and(taken)} is taken out" if taken
        else "the residual itself, for no channel explains any of it"
    )  # fmt: skip
    doubt = (
        f" The velocity is noisy by {noise.velocity:.2g} rad/s; where the prediction bends within "
        "that, the floor holds what it does to the prediction."
        if noise.velocity_matters
        else ""
    )
    where = _uneven(made)
    return (
        f"The noise floor is {left}, band by band. Its memory (autoregressive, order "
        f"{noise.order}, {seconds}) gives {made.overall.rows} rows an effective sample size of "
        f"{made.overall.effective_rows:.0f}, by which every chance is counted.{doubt}{where}"
    )


def _uneven(made: Comparison) -> str:
    """Say where a floor lies that half of the rows are far below, by what shows that best."""
    each = {name: _floor_of_half(bands) for name, bands in made.by.items()}
    if not each or made.noise_floor <= UNEVEN * min(each.values()):
        return ""
    name = min(each, key=lambda key: each[key])
    top = max(made.by[name], key=lambda band: band.noise_floor)
    low, high = (sized(value, value) for value in (each[name], top.noise_floor))
    return (
        f" It is not the same everywhere: by {made.words[name]}, it is at most {low} {made.unit} "
        f"for half of the rows, and largest, {high} {made.unit}, in the band {top.label}."
    )


def _floor_of_half(bands: Sequence[Band]) -> float:
    """The floor that bands with half of the rows do not exceed."""
    low = sorted(bands, key=lambda band: band.noise_floor)
    rows = np.cumsum([band.rows for band in low])
    return low[int(np.searchsorted(rows, 0.5 * rows[-1]))].noise_floor


def sized(value: float, beside: float) -> str:
    """Return a value with the decimals that show two digits of another."""
    if not (np.isfinite(value) and beside > 0.0):
        return f"{value:.2g}"
    decimals = 1 - int(np.floor(np.log10(beside)))
    if not -3 <= decimals <= 6:
        return f"{value:.2g}"
    shown = max(decimals, 0)
    return f"{round(value, shown) + 0.0:.{shown}f}"  # no −0.00


def legible(value: float, beside: float) -> str:
    """Return a value with two digits of another, or with four of its own where these are fewer."""
    return sized(value, max(beside, 0.01 * abs(value)))


def _where(made: Comparison) -> str:
    total = sum(f.gain for f in made.follows)
    told = [f for f in made.follows if f.gain >= WORTH_SAYING * total][:MOST]
    bands = [f for f in told if _is_band(f)]
    nouns = _NOUNS | _BESIDE if len(bands) > 1 else _NOUNS
    largest = [_located(_largest(made, f), f.name, made.units[f.name], nouns) for f in bands]
    verbs: list[str] = []
    for f in told:
        if not _is_band(f):
            verbs.append(_verb(made, f))
        elif not any(v.startswith("is largest") for v in verbs):
            verbs.append(f"is largest {_and(largest)}")
    said = f"It {_and(verbs)}"
    named = {_ONCE.get(f.name, f.words) for f in told}
    others = ([w for w in f.also if w not in named] for f in told)
    if also := next(filter(None, others), []):
        said += f" ({_and(also)} would locate it nearly as well)"
    idle = [w for w in made.makes_no_difference if w != "direction" or "direction" not in said]
    if not idle:
        return f"{said}."
    return f"{said}; beyond that it is not seen to follow {_and(idle[:MOST_IDLE], 'or')}."


def _is_band(f: Follows) -> bool:
    if f.place is None or f.name in ("offset", "direction") or " and " in f.name:
        return False
    return bool(f.place.kinds) or (1 <= len(f.place.bands) <= 2 and not f.place.whole)


def _verb(made: Comparison, f: Follows) -> str:
    unit, floor = made.unit, made.overall.noise_floor
    if f.place is None:
        each = made.orders[:3]
        orders = _and([f"{peak.per_output_turn:.5g}" for peak in each])
        sizes = _and([sized(peak.amplitude, peak.amplitude) for peak in each])
        return f"turns with the joint, {orders} times per output turn ({sizes} {unit})"
    if f.name == "offset":
        return f"is shifted everywhere by {_signed(f.place.means[0], floor)} {unit}"
    if f.name == "direction":
        pairs = zip(f.place.kinds, f.place.means, strict=True)
        each_way = listed(f"{kind} {_signed(mean, floor)} {unit}" for kind, mean in pairs)
        return f"changes with the direction ({each_way})"
    return f"changes with the {f.words} over its whole range"


def _largest(made: Comparison, f: Follows) -> Place:
    """Where the gap is largest: where what it follows is, or in the worst band where that is not.

    A mean that several things share may be largest elsewhere than the gap itself.
    """
    assert f.place is not None
    bands = made.by[f.name]
    worst = worst_band(bands)
    large = [band for band in bands if band.excess >= made.overall.excess]
    ends = tuple(e for e in f.place.bands if any(_within(band, e) for band in large))
    if not worst.significant:
        return f.place
    if _holds(f.place, worst):
        return replace(f.place, bands=ends or f.place.bands)
    if f.place.kinds:
        return Place((), (), False, (worst.label,), (worst.bias,), False)
    return Place(((worst.lower, worst.upper),), (), False, (), (), False)


def _holds(place: Place, band: Band) -> bool:
    """Whether a band is one of a place, or within one."""
    if place.kinds:
        return band.label in place.kinds
    return any(_within(band, ends) for ends in place.bands)


def _within(band: Band, ends: tuple[float | None, float | None]) -> bool:
    low, high = _closed(*ends)
    lower, upper = _closed(band.lower, band.upper)
    return low <= lower and upper <= high


def _closed(low: float | None, high: float | None) -> tuple[float, float]:
    return -np.inf if low is None else low, np.inf if high is None else high


def _located(place: Place, name: str, unit: str, nouns: Mapping[str, str]) -> str:
    if place.kinds:
        return f"in {'run' if len(place.kinds) == 1 else 'runs'} {_and(place.kinds[:5])}"
    before = nouns.get(name, "")
    bands = _and([_band(low, high, name, unit, before) for low, high in place.bands], "or")
    bands = bands.replace(f"or {before}", "or ").replace("-", "−")
    if len(place.directions) == 1:
        return f"{bands} {place.directions[0]}"
    said = place.directions and (place.turns_sign or name in ("speed", *_AFTER))
    return f"{bands} in both directions" if said else bands


def _band(low: float | None, high: float | None, name: str, unit: str, before: str) -> str:
    if name in _AFTER:
        if not low:
            return f"within {high:.3g} {unit} after reversals"
        reach = f"more than {low:.3g}" if high is None else f"from {low:.3g} to {high:.3g}"
        return f"{reach} {unit} after reversals"
    if low is None or (low == 0.0 and name == "speed"):
        return f"{before}below {high:.3g} {unit}"
    if high is None:
        return f"{before}above {low:.3g} {unit}"
    return f"{before}from {' to '.join(told_apart([low, high]))} {unit}"


def _signed(value: float, floor: float) -> str:
    return ("+" if value >= 0.0 else "") + legible(value, floor).replace("-", "−")


def _and(words: Sequence[str], last: str = "and") -> str:
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def comparison_json(made: Comparison) -> str:
    """Return the text of `comparison.json`, which fits its schema."""
    by = {name: [asdict(band) for band in bands] for name, bands in made.by.items()}
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"flexspline {__version__}",
        "target": made.what,
        "unit": made.unit,
        "simulated": made.simulated,
        "lowpass": made.lowpass,
        "sentences": list(made.sentences),
        "noise_floor_method": floor_sentence(made),
        "runs": [_run(run.log) for run in made.runs],
        "overall": asdict(made.overall),
        **{name: by.get(name, []) for name in (*ALWAYS, *REVERSAL)},
        **{name: bands for name, bands in by.items() if name not in (*ALWAYS, *REVERSAL)},
        "position_order": [_peak(peak) for peak in made.orders],
        "units": dict(made.units),
        "load_source": made.load_source or None,
        "follows": [_follows_json(f) for f in made.follows],
        "makes_no_difference": list(made.makes_no_difference),
        "noise": asdict(made.memory),
        "simulation": made.foreign or None,
        "notes": list(made.notes),
        "inputs": inputs_json(made.inputs, made.preparations),
        "bandwidth_hz": bandwidth_used(made.preparations),
        "speed_above": made.speed_above,
    }
    return checked_json(content, "comparison")


def _run(log: Any) -> dict[str, Any]:
    source = log.source
    return {
        "name": log.name,
        "rows": len(log),
        "path": source.path if source else None,
        "sha256": source.sha256 if source else None,
    }


def _peak(peak: OrderPeak) -> dict[str, Any]:
    """An order as a band: a sine of amplitude A has an RMS of A / √2, and its error likewise."""
    return {
        **asdict(peak),
        "also": list(peak.also),
        "rmse": peak.amplitude / 2**0.5,
        "variance": peak.amplitude**2 / 2,
        "bias": 0.0,
        "noise_floor": peak.error / 2**0.5,
    }


def _follows_json(found: Any) -> dict[str, Any]:
    made = asdict(found)
    made["also"] = list(found.also)
    return made
