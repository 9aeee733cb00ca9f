"""What a name has to show before it is the answer, and what a base is given beside its effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from driven_joint import driven, strokes, waves
from fit_logs import WIDTH, motion, simulated
from numpy.typing import NDArray
from recorded_joint import LOAD, VISCOUS, base, exact, recorded, runs
from scipy.signal import lfilter
from scipy.stats import chi2

import flexspline
from flexspline.discovery import analysis, confirmation
from flexspline.discovery.analysis import Analysis
from flexspline.discovery.candidates import TAKEN, freedoms, held_of, with_freedoms
from flexspline.discovery.confirmation import ERRORS, Shown, significance, together
from flexspline.discovery.result import FORMED, LESSER, UNLIKELY, UNSETTLED, Discovery
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.unexplained import Repeated
from flexspline.effects import Effect, effect
from flexspline.effects.causes import FRICTION_BY_DIRECTION as DIRECTIONS
from flexspline.effects.causes import LAG
from flexspline.formatting import padded
from flexspline.least_squares.linear import UnsettledError
from flexspline.least_squares.result import Fit, wald
from flexspline.logs.log import Log
from flexspline.prepared import noise_of_channels
from flexspline.regression.candidate_model import fall_of, rmse_error
from flexspline.report.discovery import discovery_html, verdict

Array = NDArray[np.float64]

LATE = 1.5e-3  # s
FORWARD = 0.15  # by which viscous friction forward exceeds that backward, of their mean
WITHOUT_VISCOUS = [e for e in base() if e.name != "viscous_friction"]


def of_the_load(factor: float, c: dict[str, Array]) -> Array:
    """Friction that grows with the load, Nm."""
    return np.asarray(factor * np.abs(c[LOAD]) * np.tanh(c["output_velocity"] / WIDTH))


def one_sided(c: dict[str, Array]) -> Array:
    """What viscous friction has more of forward, and less of backward, Nm."""
    return np.asarray(0.5 * FORWARD * VISCOUS * np.abs(c["output_velocity"]))


def found(effects: list[Effect], logs: list[Log], target: str = "sensor_torque") -> Discovery:
    return flexspline.discover(effects, logs, target=target, known_load=LOAD)


def value_of(made: Fit, name: str) -> tuple[float, float]:
    (one,) = (p for p in made.parameters if p.name == name)
    return one.value, one.standard_error


# ------------------------------------------------------- names that others stand for as well


def told(*names: str, groups: Sequence[Sequence[str]]) -> str:
    shown = [SimpleNamespace(effect=effect(name).with_orders([2]) if "ripple" in name
                             else effect(name)) for name in names]  # fmt: skip
    fit = SimpleNamespace(confounded=[SimpleNamespace(names=tuple(group)) for group in groups])
    return confirmation._untold(cast(Fit, fit), cast("Sequence[Shown]", shown))


def test_of_two_names_that_are_confounded_as_wholes_the_later_goes() -> None:
    """Over half a turn gravity and a ripple of order 2 are one smooth function of the angle."""
    ripple = ["output_ripple.cosine 2", "output_ripple.sine 2"]
    gravity = ["gravity.sine", "gravity.cosine"]
    both = ["offset.offset", *gravity, *ripple]
    names = ("gravity", "output_ripple", "temperature_drift")
    assert told(*names, groups=[both]) == "output_ripple"
    assert told(*names, groups=[both[:-1]]) == ""  # one of the ripple's is known
    assert told(*names, groups=[["offset.offset", *gravity], ripple]) == ""
    assert told("gravity", groups=[both]) == ""


# ------------------------------------------------------------------------------ Wald's test


@cache
def fitted() -> Fit:
    effects = [*base(), effect("nonlinear_viscous_friction"), effect("gravity")]
    return flexspline.fit(effects, runs(2), "sensor_torque", known_load=LOAD, checks=False)


@pytest.mark.parametrize("name", ["viscous_friction", "nonlinear_viscous_friction", "gravity"])
def test_significance_is_walds_test(name: str) -> None:
    made = fitted()
    known = made.part.record["covariance"]["names"]
    at = [k for k, n in enumerate(known) if n.split(".")[0] == name]
    beta = np.array([value_of(made, known[k])[0] for k in at])
    spread = made.covariance[np.ix_(at, at)]
    by_hand = chi2.sf(beta @ np.linalg.inv(spread) @ beta, len(at))
    assert len(at) == (1 if name == "viscous_friction" else 2)
    assert significance(made, name) == pytest.approx(by_hand, rel=1e-6, abs=1e-300)


def test_significance_with_shapes_held_is_that_of_a_fit_in_which_they_are() -> None:
    shape = "stribeck_friction.stribeck_velocity"
    effects = [*base(), effect("stribeck_friction")]
    generator = np.random.default_rng(8)
    logs = []
    for log in runs(2):
        v = np.gradient(log["output_position"], log["time"])
        little = 0.004 * np.sign(v) * np.exp(-((v / 0.5) ** 2))
        noise = generator.normal(0.0, 0.02, len(v))
        logs.append(
            log.with_columns({"sensor_torque": log["sensor_torque"] + little + noise}, note="more")
        )

    def made(**fixed: float) -> Fit:
        return flexspline.fit(
            effects, logs, "sensor_torque", known_load=LOAD, checks=False,
            fixed={name.replace("__", "."): value for name, value in fixed.items()},
        )  # fmt: skip

    free = made()
    held = made(stribeck_friction__stribeck_velocity=value_of(free, shape)[0])
    loose, p = (significance(free, "stribeck_friction", held=held) for held in (False, True))
    assert p == pytest.approx(significance(held, "stribeck_friction"), rel=0.3)
    assert p < loose


@pytest.mark.parametrize(("loose", "withdrawn"), [(2.1, False), (1.9, True)])
def test_a_name_whose_printed_errors_reach_zero_is_withdrawn(loose: float, withdrawn: bool) -> None:
    one = Shown(effect("gravity"), 1e-6, 5.0, 1.0, 0.1, 1.0, (2.0, 1.0), loose)
    assert bool(one.withdrawn) is withdrawn


def test_what_is_not_there_is_significant_as_rarely_as_it_should_be() -> None:
    made = fitted()
    assert significance(made, "viscous_friction") < 1e-12
    assert min(significance(made, n) for n in ("nonlinear_viscous_friction", "gravity")) > 1e-3
    assert significance(made, "cogging") == 1.0


def test_an_exact_coefficient_is_significant() -> None:
    effects, values = ["offset", "viscous_friction"], np.array([0.5, 0.25])
    log = simulated(effects, values, motion(0))
    made = flexspline.fit(effects, log, "sensor_torque", checks=False)
    assert significance(made, "viscous_friction") == 0.0
    assert significance(made, "offset") == 0.0


# ------------------------------------------------------------------------------ orders


@pytest.mark.parametrize(
    ("there", "kept"),
    [((3, 5), None), ((3,), [3]), ((5,), [5]), ((), [5])],  # of noise the smaller goes
)
def test_an_order_that_is_not_significant_is_no_part_of_a_name(
    there: tuple[int, ...], kept: list[int] | None
) -> None:
    ripple = effect("output_ripple", orders=[3, 5])
    log = simulated(["offset"], np.array([0.5]), motion(0))
    added = sum((0.02 * np.cos(k * log["output_position"]) for k in there), np.zeros(len(log)))
    noise = np.random.default_rng(4).normal(0.0, 0.02, len(log))
    added = added + noise
    log = log.with_columns({"sensor_torque": log["sensor_torque"] + added}, note="ripple")
    fit = flexspline.fit([effect("offset"), ripple], log, "sensor_torque", checks=False)
    made: Any = SimpleNamespace(
        final=SimpleNamespace(named=[ripple]),
        with_orders=lambda effect, orders: (effect, [order for order, _ in orders]),
    )
    found: Any = confirmation._without_idle_order(made, fit)
    assert found == (None if kept is None else (ripple, kept))


def test_walds_test_of_one_order_is_that_of_its_two_coefficients() -> None:
    made = fitted()
    names = ("nonlinear_viscous_friction.quadratic", "nonlinear_viscous_friction.cubic")
    name = names[0].split(".")[0]
    assert wald(made, name, terms=names) == wald(made, name)
    for term in names:
        value, error = value_of(made, term)
        square, count = wald(made, name, held=True, terms=[term])
        assert count == 1 and square == pytest.approx((value / error) ** 2, rel=1e-9)


# ------------------------------------------------------------------------------ withdrawn


def shown(**more: Any) -> Shown:
    usual = {"p": 0.0, "t": 10.0, "fall": 1.0, "error": 0.1, "share": 0.5, "without": 2.0}
    return Shown(effect("gravity"), **{**usual, **more})


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({}, ""),
        ({"p": 0.99 * SETTINGS.alpha}, ""),
        ({"p": SETTINGS.alpha}, "not significant in the final fit"),
        ({"p": float("nan")}, "not significant in the final fit"),
        ({"fall": 0.0}, "does not lower the held-out error"),
        ({"fall": -1.0}, "does not lower the held-out error"),
        ({"t": 16.0, "error": 1.0}, ""),  # below t = 16 chance may hide its fall
        ({"t": 16.1, "error": 0.51}, "does not lower the held-out error"),
        ({"t": 16.1, "error": 0.49}, ""),
    ],
)
def test_a_name_is_withdrawn_for_one_of_two_reasons(more: dict[str, float], why: str) -> None:
    assert shown(**more).withdrawn == why


class Made:
    """An analysis of names, as far as `confirmed` asks it."""

    generalised, unexplained, tied = False, 0.0, ()
    before, after = SimpleNamespace(rmse=9.0), SimpleNamespace(rmse=3.0)

    def __init__(self, names: list[str], given: list[str], refused: dict[str, str]) -> None:
        self.names, self.given = names, given
        self.searcher = SimpleNamespace(refused=refused, fitted=lambda effect: (effect, 0.0))

    @property
    def answers(self) -> bool:
        return self.unexplained <= 0.5

    @property
    def base(self) -> SimpleNamespace:
        return SimpleNamespace(effects=[Effect(name) for name in self.given])

    @property
    def final(self) -> SimpleNamespace:
        named = [Effect(name) for name in self.names]
        return SimpleNamespace(named=named, with_effects=lambda effect: effect)

    @property
    def errors(self) -> list[float]:
        return [float(error) for error in self.steps()]  # type: ignore[attr-defined]

    def without(self, *out: str) -> Made:
        left = ([n for n in names if n not in out] for names in (self.names, self.given))
        return Made(*left, self.searcher.refused)


def confirmed(
    monkeypatch: pytest.MonkeyPatch,
    each: dict[str, dict[str, float]],
    chance: tuple[str, ...] = (),
    rivals: Callable[[Any], Any] = lambda made: {name: [] for name in made.names},
    steps: Callable[[Any], list[float]] = lambda made: [*range(len(made.names) + 1, 0, -1)],
    sure: Mapping[str, float] | None = None,
    told: Callable[[Any], list[float]] | None = None,
    beside: float = 0.5,
    unsettled: Sequence[str] = (),
    alone: Mapping[str, dict[str, float]] | None = None,
    **idle: float,
) -> tuple[confirmation.Confirmed, dict[str, str]]:
    """What is confirmed of names that show `each`; `idle`: p of what the base was given.

    `chance`: which of that lowers the held-out error by no more than chance. `steps`: held-out
    errors of the base and with one name more each, by the search; `told`: by fits, if others.
    `sure`: confidence in names; 1 in others. `beside`: held-out error of a small one beside all.
    `unsettled`: names with which no fit settles. `alone`: what names show without any other.
    """

    def all_shown(made: Any, fit: Any) -> list[Shown]:
        usual = {"p": 0.0, "t": 9.0, "fall": 1.0, "error": 0.1, "share": 0.5, "without": 2.0}
        own = {**each, **(alone or {})} if len(made.names) == 1 else each
        return [Shown(Effect(name), **{**usual, **own[name]}) for name in made.names]

    def fit(final: Any) -> Any:
        if any(effect.name in unsettled for effect in final.named):
            raise UnsettledError("the load does not settle")
        return SimpleNamespace(generalised=False, confounded=())

    monkeypatch.setattr(confirmation, "_all_shown", all_shown)
    monkeypatch.setattr(confirmation, "_in_order", lambda made: made)
    monkeypatch.setattr(confirmation, "_rivals", rivals)
    of_names = {
        n: confirmation.Sure(p, "") for n, p in {**dict.fromkeys(each, 1.0), **(sure or {})}.items()
    }
    monkeypatch.setattr(confirmation, "_sure", lambda made, fit, name, own: of_names[name])
    monkeypatch.setattr(Made, "steps", steps, raising=False)

    def told_steps(made: Any, *_: Any) -> SimpleNamespace:
        return SimpleNamespace(rmse=told(made) if told else made.errors)

    monkeypatch.setattr(confirmation, "_steps", told_steps)
    monkeypatch.setattr(confirmation, "significance", lambda fit, name: idle[name])

    def settled(made: Any, base: Sequence[str]) -> Any:
        for name in chance:
            made = made.without(name)
        return made

    monkeypatch.setattr(confirmation, "_settled", settled)
    refused: dict[str, str] = {}
    made = Made([*each], ["offset", *idle], refused)

    def left_by(effect: Any, like: Any) -> tuple[np.ndarray, ...]:
        return (np.array([beside]),)

    found = confirmation.confirmed(made, fit, left_by, ["offset"])  # type: ignore[arg-type]
    return found, refused


def test_names_that_fail_are_withdrawn_and_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    each = {"viscous_friction": {}, "gravity": {"p": 0.3}, "inertia": {"fall": -1.0, "p": 1e-9}}
    held, refused = confirmed(monkeypatch, each)
    assert [*held.shown] == ["viscous_friction"] and held.also_seen == ()
    assert refused == {
        "gravity": "not significant in the final fit",
        "inertia": "does not lower the held-out error",
    }


def test_what_is_real_but_small_is_also_seen_and_what_may_be_chance_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    little, error = 0.9 * SETTINGS.form, 0.01
    each = {
        "viscous_friction": {"t": 1.1 * 9.0 / SETTINGS.little},
        "gravity": {"share": little, "fall": 1.1 * ERRORS * error, "error": error},
        "inertia": {"share": little, "fall": 0.9 * ERRORS * error, "error": error},
    }
    held, refused = confirmed(monkeypatch, each)
    assert [*held.shown] == ["viscous_friction"]
    assert [one.effect for one in held.also_seen] == ["gravity"]
    assert held.also_seen[0].share_of_gap == little
    assert (held.also_seen[0].rmse_before, held.also_seen[0].rmse_after) == (1.0, 0.5)
    assert refused == {"inertia": "too small to be seen held out"}
    held, refused = confirmed(monkeypatch, each, beside=1.1)
    assert not held.also_seen
    assert refused == dict.fromkeys(("gravity", "inertia"), "too small to be seen held out")


def test_what_is_as_plain_as_the_rest_is_never_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ripple beside slow noise: next to nothing in RMS, and hundreds of standard errors."""
    each = {"viscous_friction": {"t": 400.0}, "cogging": {"share": 0.1 * SETTINGS.form, "t": 41.0}}
    held, refused = confirmed(monkeypatch, each)
    assert [*held.shown] == [*each] and not refused and held.also_seen == ()


def test_the_only_name_is_never_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    held, refused = confirmed(monkeypatch, {"gravity": {"share": 0.1 * SETTINGS.form}})
    assert [*held.shown] == ["gravity"] and not refused and held.also_seen == ()


def test_what_others_explain_as_well_is_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four aliases: any of five effects."""
    each: dict[str, dict[str, float]] = {"viscous_friction": {}, "gravity": {}}

    def rivals(made: Any) -> dict[str, list[Any]]:
        vague = [SimpleNamespace(alias=True, more=True)] * SETTINGS.tried
        return {name: vague if name == "gravity" else vague[1:] for name in made.names}

    held, refused = confirmed(monkeypatch, each, rivals=rivals)
    assert [*held.shown] == ["viscous_friction"] and len(held.rivals["viscous_friction"]) == 3
    assert refused == {"gravity": UNLIKELY}


@pytest.mark.parametrize(("off", "taken"), [(0.3, "viscous_friction"), (0.09, None), (0.02, None)])
def test_of_equals_that_one_is_named_which_predicts_unseen_rows_better(
    monkeypatch: pytest.MonkeyPatch, off: float, taken: str | None
) -> None:
    """iiwa, joint 2: a ripple of order 2 at 4.84 Nm where gravity leaves 2.93 Nm, "or gravity".

    What has more coefficients is no better for that: it may follow what else is missing. Nor is
    what lowers the mean square by less than 1 %, 9 standard errors here: gravity and the first
    order of a ripple had been exchanged without end.
    """
    noise = np.random.default_rng(5).normal(size=40_000)
    problem = SimpleNamespace(block_rows=100)
    leaves = {"inertia": off, "coulomb_friction": 2.0 * off, "gravity": 0.0}

    def left(name: str) -> SimpleNamespace:
        residual = noise + leaves.get(name, 0.0)
        rmse = float(np.sqrt(np.mean(residual**2)))
        return SimpleNamespace(residuals=[residual], rmse=rmse, problem=problem, folds=())

    made = SimpleNamespace(
        final=SimpleNamespace(named=[Effect("inertia")]),
        after=left("inertia"),
        searcher=SimpleNamespace(fitted=lambda name: (name, 0.0)),
        left_by=left,
        of=lambda name: name,
    )
    monkeypatch.setattr(confirmation, "in_place_of", lambda work, name, effect: effect.name)
    monkeypatch.setattr(confirmation, "_in_order", lambda made: made)
    equals = [
        SimpleNamespace(alias=True, more=False, effect=Effect(name))
        for name in ("gravity", "coulomb_friction", "viscous_friction")
    ]
    found = confirmation._better_equal(made, {"inertia": equals})  # type: ignore[arg-type]
    assert found == taken


@pytest.mark.parametrize(("first", "second", "kept"), [(0.21, 0.1, 2), (0.19, 0.9, 1)])
def test_a_first_name_less_likely_than_one_in_five_is_none(
    monkeypatch: pytest.MonkeyPatch, first: float, second: float, kept: int
) -> None:
    """One behind a first name that is likely stays."""
    each: dict[str, dict[str, float]] = {"viscous_friction": {}, "gravity": {}}
    sure = {"viscous_friction": first, "gravity": second}
    held, refused = confirmed(monkeypatch, each, sure=sure)
    assert [*held.shown] == [*each][2 - kept :]
    assert refused == ({} if kept == 2 else {"viscous_friction": UNLIKELY})


@pytest.mark.parametrize(
    ("square", "large", "kept"),
    [(60.0, 1e4, 1), (80.0, 1e4, 2), (250.0, 1e5, 1), (260.0, 1e5, 2), (60.0, 60.0, 2)],
)
def test_a_name_behind_a_larger_one_is_certain_or_shows_more_than_its_form_may_miss(
    monkeypatch: pytest.MonkeyPatch, square: float, large: float, kept: int
) -> None:
    """0.7 % of the χ² of the larger one; at 16 standard errors it is certain."""
    each = {"gravity": {"square": large}, "viscous_friction": {"square": square}}
    held, refused = confirmed(monkeypatch, each)
    assert [*held.shown] == [*each][:kept]
    assert refused == ({} if kept == 2 else {"viscous_friction": FORMED})


def test_what_closes_most_of_the_gap_is_no_form_of_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind the noise's filter presliding had thirty times the evidence of 12 Nm of gravity."""
    each = {"presliding_friction": {"square": 1e4}, "gravity": {"square": 60.0, "fall": 70.0}}
    held, refused = confirmed(monkeypatch, each)
    assert [*held.shown] == [*each] and not refused
    less = {**each, "gravity": {"square": 60.0, "fall": 60.0}}
    assert [*confirmed(monkeypatch, less)[0].shown] == ["presliding_friction"]


@pytest.mark.parametrize(("unexplained", "kept"), [(0.49, 2), (0.51, 0)])
def test_no_name_stands_beside_more_that_is_unexplained(
    monkeypatch: pytest.MonkeyPatch, unexplained: float, kept: int
) -> None:
    """Whoever reads that most of the gap is unexplained reads no answer beside it."""
    monkeypatch.setattr(Made, "unexplained", unexplained)
    each: dict[str, dict[str, float]] = {"viscous_friction": {}, "gravity": {}}
    held, refused = confirmed(monkeypatch, each)
    assert [*held.shown] == [*each][:kept]
    assert refused == ({} if kept else dict.fromkeys(each, LESSER))


@pytest.mark.parametrize(
    ("again", "after", "kept"),
    [(16.9, 8.0, True), (17.1, 8.0, False), (13.0, 3.0, True), (0.0, 8.0, True)],
)
def test_what_comes_again_at_the_same_place_is_unexplained_too(
    again: float, after: float, kept: bool
) -> None:
    made: Any = SimpleNamespace(
        before=SimpleNamespace(rmse=9.0),
        after=SimpleNamespace(rmse=after),
        unexplained=0.0,
        again=Repeated(again, 0.1, ("output_position",)) if again else None,
    )
    answers: Any = Analysis.answers
    assert answers.fget(made) is kept


def test_coarse_quanta_of_a_torque_are_no_ripple() -> None:
    """Steps of 2 Nm were orders 7 and 11 at 99 %, for 0.002 of 0.625 Nm."""
    logs = []
    for seed, angle in enumerate((strokes(), waves(), waves()[::-1].copy(), strokes(20.0))):
        log = driven(angle, 0.0, inertia=0.6, bits=17, seed=seed)
        torque = 2.0 / 80.0 * np.round(log["motor_torque"] * 80.0 / 2.0)
        logs.append(log.with_columns({"motor_torque": torque}, note="quanta"))
    base = ["offset", "coulomb_friction", "viscous_friction", "inertia", "gravity"]
    made = flexspline.discover(base, logs, target="motor_torque")
    assert made.names == () and made.unexplained is not None


def test_of_names_that_raise_the_error_that_goes_first_without_which_it_is_lowest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One extrapolates wildly and is significant; beside it the other lowers nothing either."""
    wild = {"p": 1e-128, "t": 23.7, "fall": -0.0985, "error": 0.175, "without": 0.105}
    beside = {"p": 1e-80, "t": 19.9, "fall": -0.067, "error": 0.086, "without": 0.206}
    each = {"nonlinear_viscous_friction": beside, "position_dependent_friction": wild}
    held, refused = confirmed(
        monkeypatch, each, alone={"nonlinear_viscous_friction": {"t": 19.9, "without": 0.108}}
    )
    assert [*held.shown] == ["nonlinear_viscous_friction"]
    assert refused == {"position_dependent_friction": "does not lower the held-out error"}


def test_no_name_raises_the_error_of_those_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second stands beside the first by chance alone; without it the first is asked again."""
    each = {"viscous_friction": {"p": 1e-9}, "gravity": {"p": 1e-5, "fall": 0.1}}
    errors = {2: [1.0, 1.1, 0.9], 1: [1.0, 1.1]}

    def steps(made: Any) -> list[Any]:
        return errors.get(len(made.names), [1.0])

    held, refused = confirmed(monkeypatch, each, steps=steps)
    assert not held.shown and set(refused.values()) == {"does not lower the held-out error"}


def test_a_name_that_raises_the_error_of_fits_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search holds shapes on all folds; where a fit of each tells otherwise, its number counts.

    What is printed is what `fit` says of the same model.
    """
    each: dict[str, dict[str, float]] = {"viscous_friction": {}, "gravity": {}}

    def told(made: Any) -> list[float]:
        return [2.0, 1.0, 1.5][: len(made.names) + 1]

    held, refused = confirmed(monkeypatch, each, told=told)
    assert [*held.shown] == ["viscous_friction"] and held.steps.rmse == [2.0, 1.0]
    assert refused == {"gravity": "does not lower the held-out error"}


@pytest.mark.parametrize(
    ("raising", "left"),
    [("load_dependent_friction", ["gravity", "viscous_friction"]), ("viscous_friction", None)],
)
def test_a_name_whose_load_does_not_settle_is_withdrawn(
    monkeypatch: pytest.MonkeyPatch, raising: str, left: list[str] | None
) -> None:
    """Where no name reads the load, it is the base's, and the user's to mend."""
    each: dict[str, dict[str, float]] = {"gravity": {}, raising: {}}
    each = each if left is None else {**each, "viscous_friction": {}}
    unsettled = [raising]
    if left is None:
        with pytest.raises(UnsettledError, match="does not settle"):
            confirmed(monkeypatch, each, unsettled=unsettled)
        return
    held, refused = confirmed(monkeypatch, each, unsettled=unsettled)
    assert [*held.shown] == left and refused == {raising: UNSETTLED}


def test_of_a_step_whose_load_does_not_settle_the_search_tells_the_error() -> None:
    models = ["base", "one", "two", "three"]
    searched = SimpleNamespace(residuals=(np.array([3.0, np.nan, -3.0]),))
    made: Any = SimpleNamespace(
        nested=models,
        base="base",
        final=SimpleNamespace(named=models[1:]),
        left_by={"one": searched}.__getitem__,
    )
    sizes = {"base": 4.0, "two": 2.0}
    held_out = np.array([1.0, -1.0, np.nan])
    fit: Any = SimpleNamespace(runs=[SimpleNamespace(held_out=held_out)], cv_rmse=1.0)

    def left_by(work: Any, like: Any) -> tuple[NDArray[np.float64], ...]:
        assert like is fit
        if work == "one":
            raise UnsettledError("the load does not settle")
        return (np.array([sizes[work], np.nan, -sizes[work]]),)

    steps = confirmation._steps(made, fit, left_by)
    assert steps.rmse == [4.0, 3.0, 2.0, 1.0]
    assert np.isnan(steps.before[0][1]) and steps.after[0] is held_out


def test_names_that_lower_it_together_stay_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of two raises the error alone; both are lost where one of them is left out."""
    each: dict[str, dict[str, float]] = {"viscous_friction": {}, "gravity": {}}
    held, refused = confirmed(monkeypatch, each, steps=lambda made: [1.0, 1.1, 0.4])
    assert [*held.shown] == [*each] and not refused


@pytest.mark.parametrize(
    ("errors", "groups"),
    [
        ([1.0], []),
        ([1.0, 0.5, 0.2], [(0, 1), (1, 2)]),
        ([1.0, 1.1, 0.4, 0.3], [(0, 2), (2, 3)]),
        ([1.0, 0.5, 0.6, 0.7], [(0, 1), (1, 3)]),
        ([1.0, 1.0], [(0, 1)]),
    ],
)
def test_names_are_grouped_where_the_error_is_lower(
    errors: list[float], groups: list[tuple[int, int]]
) -> None:
    assert together(errors) == groups


def test_what_the_base_was_given_stays_where_it_is_significant(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    held, refused = confirmed(monkeypatch, {}, **{DIRECTIONS: 0.0, LAG: SETTINGS.alpha})
    assert [e.name for e in held.made.base.effects] == ["offset", DIRECTIONS]
    assert refused == {}
    held, _ = confirmed(monkeypatch, {}, (DIRECTIONS,), **{DIRECTIONS: 0.0, LAG: 0.0})
    assert [e.name for e in held.made.base.effects] == ["offset", LAG]


def held(*residuals: Sequence[float]) -> list[Array]:
    return [np.array(part, dtype=float) for part in residuals]


def test_the_error_of_an_rmse_counts_the_memory_of_what_is_left() -> None:
    """White noise would be known three times as well as this (autoregressive, 0.9)."""
    rng, found, errors = np.random.default_rng(5), list[float](), list[float]()
    for _ in range(200):
        left = tuple(lfilter([1.0], [1.0, -0.9], rng.normal(size=4000)) for _ in range(2))
        left[0][:7] = np.nan
        found.append(float(np.sqrt(np.nanmean(np.concatenate(left) ** 2))))
        errors.append(rmse_error(left, 200))
    assert np.mean(errors) == pytest.approx(np.std(found), rel=0.15)
    white = found[0] / np.sqrt(2 * 8000)
    assert errors[0] > 2.0 * white


def test_one_block_tells_no_error_of_an_rmse() -> None:
    assert np.isnan(rmse_error((np.ones(10),), 100))


def test_the_fall_of_the_held_out_error_is_that_of_its_squares() -> None:
    before = held(np.sqrt([3.0] * 4 + [5.0] * 4), [2.0, np.nan])
    after = held(np.ones(8), [1.0, 1.0])
    fall, error = fall_of(before, after, 4)
    assert fall == pytest.approx((4 * 2.0 + 4 * 4.0 + 3.0) / 9.0)
    sums = [4 * 2.0 * (np.sqrt(3.0) - 1.0), 4 * 2.0 * (np.sqrt(5.0) - 1.0), 2.0]
    assert error == pytest.approx(np.linalg.norm(sums) / 9.0)
    one = held(np.ones(3))
    assert fall_of(one, one, 10) == (0.0, np.inf)


@pytest.mark.parametrize(("beyond", "told"), [(30.0, True), (0.0, True), (None, False)])
def test_a_fold_beyond_all_others_is_no_chance(beyond: float | None, told: bool) -> None:
    """What all models foretell badly there would drown a fall that five other folds show."""
    generator = np.random.default_rng(8)
    noise, part = generator.normal(0.0, 1.0, 6000), np.sin(0.1 * np.arange(6000.0))
    rows = np.arange(6000)
    off = np.where(rows < 1000, (beyond or 0.0) * np.cos(0.003 * rows), 0.0)
    share = 0.0 if beyond is None else 0.5
    folds = [SimpleNamespace(run=0, first=k, last=k + 1000) for k in range(0, 6000, 1000)]
    problem = SimpleNamespace(block_rows=50)
    whole, rest = (
        SimpleNamespace(problem=problem, folds=folds, residuals=(left,))
        for left in (noise + off, noise + off + share * part)
    )
    fall, error = confirmation._fall(rest, whole)  # type: ignore[arg-type]
    assert (fall > ERRORS * error) is told


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_the_error_of_the_fall_is_its_spread_over_draws_of_the_noise(memory: float) -> None:
    """Both of a motion that shows the effect in one tenth of the rows alone, and of slow noise."""
    rows, effect, draws = 4000, np.zeros(4000), []
    effect[:400] = 0.5 * np.sin(np.arange(400) / 20.0)
    rng = np.random.default_rng(7)
    for _ in range(400):
        noise = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.normal(size=rows))
        draws.append(fall_of(held(noise + effect), held(noise), 50))
    falls, errors = np.transpose(draws)
    assert np.mean(falls) == pytest.approx(np.mean(effect**2), rel=0.1)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(np.std(falls), rel=0.15)


# ------------------------------------------------------------------------------ on short runs


@pytest.mark.parametrize(
    ("factor", "names"),
    [
        (0.04, ("viscous_friction", "load_dependent_friction")),
        (0.25, ("load_dependent_friction", "viscous_friction")),
    ],
)
def test_names_stand_in_the_order_of_what_they_close_held_out(
    factor: float, names: tuple[str, ...]
) -> None:
    made = found(WITHOUT_VISCOUS, runs(added=lambda c: of_the_load(factor, c)))
    assert made.names == names
    value, error = value_of(made.fit, "load_dependent_friction.factor")
    assert abs(value - factor) < 4.0 * error < 0.05 * factor
    errors = [made.base_rmse, *(one.rmse_after for one in made.found)]
    assert errors == sorted(errors, reverse=True)
    assert all(
        one.coefficients_p < SETTINGS.alpha and one.share_of_gap > SETTINGS.form
        for one in made.found
    )


@pytest.mark.parametrize("factor", [0.004, 0.0012])
def test_what_takes_a_hundredth_of_the_squares_that_are_left_is_a_name(factor: float) -> None:
    made = found(WITHOUT_VISCOUS, runs(added=lambda c: of_the_load(factor, c)))
    assert made.names == ("viscous_friction", "load_dependent_friction") and not made.also_seen
    last = made.found[-1]
    assert last.rmse_after < np.sqrt(0.99) * last.rmse_before and last.t > SETTINGS.certain
    value, error = value_of(made.fit, "load_dependent_friction.factor")
    assert abs(value - factor) < 4.0 * error < 0.001


def test_a_small_effect_is_seen_and_no_part_of_the_model() -> None:
    made = found(WITHOUT_VISCOUS, runs(added=lambda c: of_the_load(0.0004, c)))
    assert made.names == ("viscous_friction",)
    (little,) = made.also_seen
    assert little.effect == "load_dependent_friction" and 0.0 < little.share_of_gap < SETTINGS.form
    assert little.rmse_after < little.rmse_before
    assert little.effect not in [e.name for e in made.fit.part.effects]
    assert little.effect not in made.refused and little.effect in str(made)


@pytest.mark.parametrize("backward", [0.0, 0.1, 1.0])
def test_what_acts_one_way_alone_is_no_effect_of_both(backward: float) -> None:
    """Viscous friction that grows with speed; no effect, of ten times as much forward as back."""

    def grows(c: dict[str, Array]) -> Array:
        v = c["output_velocity"]
        return np.asarray(np.where(v > 0.0, 1.0, backward) * v * np.abs(v))

    made = found(base(), runs(added=grows))
    if backward == 1.0:
        assert made.names == ("nonlinear_viscous_friction",) and made.unexplained is None
    else:
        assert made.names == () and made.unexplained is not None
        assert made.unexplained.depends_on[0] == "output_velocity"
        assert "nonlinear_viscous_friction" in made.doubted


@pytest.mark.parametrize("target", ["sensor_torque", "motor_torque"])
def test_a_late_load_cell_is_a_fault_with_its_size_and_no_name(target: str) -> None:
    made = found(base(), runs(target=target, late=LATE), target)
    assert made.names == () and made.unexplained is None
    faults = [f for f in made.data_faults if f.name == "load_delay"]
    assert [f.run for f in faults] == [f"run{k}" for k in range(5)]
    for fault in faults:
        assert fault.channel == LOAD and fault.unit == "s"
        assert fault.size == pytest.approx(LATE, rel=0.05)
        assert f"shift={LOAD}:" in fault.sentence
    assert LAG not in [e.name for e in made.fit.part.effects]
    assert made.not_tried[LAG] == TAKEN and f"Not tried, {TAKEN}: {LAG}." in " ".join(
        str(made).split()
    )
    assert made.final_rmse < 0.012  # the target's own noise is 0.01 Nm


@cache
def differing() -> Discovery:
    """Friction that differs between the directions."""
    return found(base(), runs(added=one_sided))


def test_friction_that_differs_between_directions_is_reported_and_names_nothing() -> None:
    made = differing()
    assert made.names == () and made.also_seen == () and made.unexplained is None
    assert DIRECTIONS in [e.name for e in made.fit.part.effects]
    value, error = value_of(made.fit, f"{DIRECTIONS}.viscosity")
    assert abs(value - 0.5 * FORWARD * VISCOUS) < 4.0 * error < 0.1 * value
    assert DIRECTIONS in str(made.fit)
    assert DIRECTIONS not in made.base_effects
    said, without = verdict(made), made.without_directions
    assert without is not None and said.startswith("Nothing else ")
    assert "friction differs between directions (viscosity by " in said
    assert said.endswith(f"; without it about {padded(without)} Nm.")
    assert said in " ".join(str(made).split()) and said in discovery_html(made)


def test_the_error_without_friction_by_direction_is_that_of_a_fit_without_it() -> None:
    made = differing()
    logs = runs(added=one_sided)
    plain = flexspline.fit(base(), logs, "sensor_torque", known_load=LOAD)
    left = np.concatenate([run.measured - run.predicted for run in plain.runs])
    assert made.without_directions is not None and made.final_rmse < 0.5 * made.without_directions
    assert made.without_directions == pytest.approx(np.sqrt(np.mean(left**2)), rel=0.05)


def test_friction_that_differs_by_next_to_nothing_is_not_in_the_headline() -> None:
    made = differing()
    little = made.final_rmse / (1.0 - 0.99 * SETTINGS.negligible)
    for without in (little, None):
        said = verdict(replace(made, without_directions=without))
        assert said.startswith("Nothing is missing ") and "directions" not in said
    assert "Friction differs between directions" in str(replace(made, without_directions=little))


@pytest.mark.parametrize("grows", [True, False])
def test_friction_of_the_angle_that_grows_with_the_speed_is_no_friction_of_the_angle(
    monkeypatch: pytest.MonkeyPatch, grows: bool
) -> None:
    """Where functions of the channels do not take the name back, its size at all speeds does."""

    def of_the_angle(c: dict[str, Array]) -> Array:
        v, size = c["output_velocity"], 0.1 * np.sin(2.0 * c["output_position"])
        return np.asarray(size * (v if grows else np.tanh(v / WIDTH)))

    monkeypatch.setattr(analysis, "_spurious", lambda *_: None)
    made = found(base(), runs(added=of_the_angle))
    name = "position_dependent_friction"
    assert (name in made.doubted, name in made.names) == (grows, not grows)


@pytest.mark.parametrize(("depth", "named"), [(0.2, True), (0.6, False)])
def test_a_gain_that_varies_with_the_angle_is_no_gain_error(depth: float, named: bool) -> None:
    """Of its squares 2 and 18 % vary: a name is a constant times its form but for a small part."""

    def over_the_angle(c: dict[str, Array]) -> Array:
        return np.asarray(0.02 * c[LOAD] * (1.0 + depth * np.sin(c["output_position"])))

    made = found(base(), runs(added=over_the_angle))
    if named:
        assert made.names == ("gain_error",) and made.withdrawn == {}
    else:
        assert made.names == () and made.unexplained is not None
        assert {*made.unexplained.depends_on} == {"output_position", LOAD}
        assert made.withdrawn == {"gain_error": f"{analysis.VARIES} output_position"}
        assert f"Withdrawn: gain_error ({made.withdrawn['gain_error']})." in " ".join(
            str(made).split()
        )


def test_a_drag_that_grows_with_the_square_of_the_speed_one_way_is_no_friction_of_both() -> None:
    """Large enough that names explain most of the gap, so that the flexible basis rejects none."""

    def forward(c: dict[str, Array]) -> Array:
        v = c["output_velocity"]
        return np.asarray(0.3 * np.where(v > 0.0, v**2, 0.0))

    made = found(base(), runs(5, added=forward))
    assert made.names == () and made.unexplained is not None
    assert made.unexplained.depends_on[0] == "output_velocity"


def test_nothing_is_added_to_a_base_that_is_whole() -> None:
    made = found(base(), runs())
    assert made.names == () and made.data_faults == ()
    assert [e.name for e in made.fit.part.effects] == [e.name for e in base()]


@pytest.mark.parametrize("differs", [False, True])
def test_beside_no_offset_the_level_is_held(differs: bool) -> None:
    made = found(base()[1:], runs(offset=False, added=one_sided if differs else None))
    effects = [e.name for e in made.fit.part.effects]
    assert made.names == () and (DIRECTIONS in effects) == differs
    if differs:
        states = {p.name: p.state for p in made.fit.parameters}
        assert states[f"{DIRECTIONS}.level"] == "fixed"
        assert value_of(made.fit, f"{DIRECTIONS}.level")[0] == 0.0
        assert value_of(made.fit, f"{DIRECTIONS}.viscosity")[0] == pytest.approx(
            0.5 * FORWARD * VISCOUS, rel=0.05
        )


# ------------------------------------------------------------------------------ freedoms


def freedoms_of(logs: list[Log], effects: list[Effect], target: str, load: str | None):
    return freedoms(effects, target, load, logs, noise_of_channels(logs))


def test_freedom_is_given_to_friction_both_ways_and_to_a_noisy_load_cell() -> None:
    logs = runs(2)
    assert freedoms_of(logs, base(), "sensor_torque", LOAD) == (DIRECTIONS, LAG)
    assert freedoms_of(logs, base(), "motor_torque", None) == (DIRECTIONS,)
    assert freedoms_of(logs, [effect("inertia")], "sensor_torque", LOAD) == (LAG,)
    assert freedoms_of(logs, base(), "torsion", LOAD) == ()
    whole = [*base(), effect(DIRECTIONS), effect(LAG)]
    assert freedoms_of(logs, whole, "sensor_torque", LOAD) == ()


def test_a_lag_is_no_freedom_of_a_current_beside_a_load_of_the_models_own() -> None:
    """`fit` refuses their sum, which is of Nm and A; so no base is given it."""
    heavy = [effect("coulomb_friction"), effect("inertia")]
    assert freedoms_of(runs(2), heavy, "motor_torque", LOAD) == (DIRECTIONS, LAG)
    assert freedoms_of(runs(2), heavy, "motor_current", LOAD) == (DIRECTIONS,)


def test_runs_that_go_one_way_have_no_freedom_of_direction() -> None:
    def one_way(log: Log) -> Log:
        rising = 2.0 * log["time"] + 0.1 * np.sin(log["time"])
        noise = np.random.default_rng(1).normal(0.0, 1e-5, len(log))
        return log.with_columns({"output_position": rising + noise}, note="one way")

    logs = [one_way(recorded(seed)) for seed in range(2)]
    assert freedoms_of(logs, base(), "sensor_torque", LOAD) == (LAG,)
    back = logs[0].with_columns({"output_position": -logs[0]["output_position"]}, note="back")
    assert DIRECTIONS in freedoms_of([logs[0], back], base(), "sensor_torque", LOAD)


def test_exact_runs_are_given_nothing() -> None:
    logs = [Log.from_arrays(**exact(seed), sensor_torque=exact(seed)[LOAD]) for seed in range(2)]
    assert freedoms_of(logs, base(), "sensor_torque", LOAD) == ()


def at_speeds(*velocity: float) -> Any:
    """A problem of one run with these velocities, as far as `held_of` asks it."""
    channels = {"output_velocity": np.array(velocity)}
    run = SimpleNamespace(channels=channels, stretches=((0, len(velocity)),))
    return SimpleNamespace(runs=[run])


def test_what_a_base_is_given_has_its_width_and_stands_behind_it() -> None:
    made, problem = with_freedoms(base(), (DIRECTIONS, LAG)), at_speeds(-1.0, 0.1 * WIDTH, 1.0)
    assert [e.name for e in made[-2:]] == [DIRECTIONS, LAG]
    assert made[-2].shapes["direction_width"] == WIDTH
    lag = {f"{LAG}.smoothing_time": 1e-4}  # a difference
    assert held_of(made, (DIRECTIONS, LAG), problem) == lag
    assert held_of(made, (DIRECTIONS,), problem) == {}  # a lag that is named is fitted whole
    assert held_of(made[1:], (DIRECTIONS,), problem) == {f"{DIRECTIONS}.level": 0.0}
    assert held_of(base()[1:], (), problem) == {}
    fast = at_speeds(-1.0, -10.0 * WIDTH, 5.0 * WIDTH)  # the level is an offset
    assert held_of(made, (DIRECTIONS,), fast) == {f"{DIRECTIONS}.level": 0.0}
