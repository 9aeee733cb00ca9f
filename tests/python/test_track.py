"""What changed in a joint over months: told, named, dated and foretold, or said not to be known."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from worn_joints import FIRST, LEVELS, NAMES, NOISES, ramp, step, worn_history

from flexspline import InputError
from flexspline.tracking import History, Track, track
from flexspline.tracking.attribution import weights_of
from flexspline.tracking.changes import (
    LEAST_SESSIONS,
    Candidates,
    Series,
    evidence_over_time,
    threshold,
)

COULOMB, LOAD, OFFSET = NAMES


def week(number: float) -> datetime:
    return (FIRST + np.timedelta64(round(7 * 24 * number), "h")).astype("M8[s]").astype(datetime)


def laws(made: Track) -> None:
    """What holds of every track, whatever the sessions were."""
    states = {p.name: p.state for p in made.parameters}
    for change in made.changes:
        low, high = change.interval
        assert low > 0.0 or high < 0.0
        assert low <= change.size <= high
        assert change.evidence > change.needed
        assert change.between[0] <= change.date <= change.between[1]
        assert states[change.parameter] == ("changed" if change.known else "may have changed")
        assert 0.95 <= sum(change.chances) <= 1.0 + 1e-9
        assert change.needs == "" or change.known
    for forecast in made.forecasts:
        if forecast.within_95[0] is not None:
            assert states[forecast.parameter] == "changed"
            assert forecast.why_none == ""
        else:
            assert forecast.date is None
            assert forecast.why_none
    told = {c.parameter.partition(".")[0] for c in made.changes}
    for name, state in states.items():
        assert state in ("no change told", "not known yet") or any(
            name.partition(".")[0] in cause or name.partition(".")[0] in told
            for change in made.changes
            for cause in change.causes
        )
    content = json.loads(made.to_json())
    assert [c["sentence"] for c in content["changes"]] == [c.sentence for c in made.changes]
    assert all(len(line) <= 120 for line in str(made).splitlines())
    assert bool(made.changes) == ("told (" in made.verdict and "no change" not in made.verdict)


@pytest.mark.parametrize("name", NAMES)
def test_a_step_is_told_of_the_parameter_that_made_it(name: str) -> None:
    made = track(worn_history(1, worn={name: step(50, 3.0)}))
    laws(made)
    (change,) = made.changes
    assert change.causes == (name,)
    assert change.kind in ("step", None) and change.per_year == 0.0
    assert change.between[0] <= week(50) <= change.between[1]
    noise = NOISES[NAMES.index(name)]
    assert change.interval[0] <= 3.0 * noise <= change.interval[1]
    assert change.told_since <= week(56)


def test_wear_is_told_as_gradual_with_its_limit_in_an_interval() -> None:
    limit = LEVELS[0] + NOISES[0] * 12.0
    made = track(worn_history(2, 100, worn={COULOMB: ramp(40, 8.0)}), limits={COULOMB: limit})
    laws(made)
    (change,) = made.changes
    assert change.causes == (COULOMB,)
    assert change.at_once < 0.1
    assert change.per_year == pytest.approx(8.0 * NOISES[0], rel=0.3)
    (forecast,) = made.forecasts
    reached = week(40 + 52.18 * 12.0 / 8.0)
    first, last = forecast.within_95
    assert first is not None
    assert first <= reached
    assert last is None or reached <= last
    assert ("reaches" if forecast.date else "may reach") in forecast.sentence


@pytest.mark.parametrize("count", [LEAST_SESSIONS, LEAST_SESSIONS + 1])
def test_of_the_fewest_sessions_level_band_limit_and_verdict_follow_the_change(count: int) -> None:
    """Wear of 1 Nm a week: level, band and limit are of the change that is told."""
    worn = {COULOMB: ramp(0, 521.8)}
    made = track(
        worn_history(2, count, worn=worn, temperature=np.full(count, 22.0)),
        limits={COULOMB: "290%"},
    )
    laws(made)
    (change,) = made.changes
    own = made[COULOMB]
    assert own.now[0] - own.at_first[0] == pytest.approx(change.size, abs=change.error)
    band = own.band.middle
    assert band[0] == pytest.approx(own.at_first[0], abs=own.at_first[1])
    assert np.ptp(band) > 0.9 * change.size
    assert change.needs in made.verdict
    (forecast,) = made.forecasts
    assert forecast.limit == pytest.approx(2.9 * LEVELS[0], rel=0.05)
    assert forecast.date is not None and week(9) <= forecast.date <= week(11)


def test_a_limit_far_away_has_no_date_and_one_that_is_passed_says_so() -> None:
    history = worn_history(2, 100, worn={COULOMB: ramp(40, 8.0)})
    far, passed, still = (
        track(history, limits={name: limit}).forecasts[0]
        for name, limit in ((COULOMB, 500.0), (COULOMB, 5.3), (OFFSET, 0.8))
    )
    assert "not within 5 years" in far.sentence
    assert "beyond it already" in passed.sentence
    assert "no change of it is told" in still.sentence
    assert all(f.date is None and f.within_95 == (None, None) for f in (far, passed, still))


def test_a_limit_below_the_level_at_first_is_a_lower_one_and_says_so() -> None:
    grown = worn_history(2, 100, worn={COULOMB: ramp(40, 8.0)})
    fallen = worn_history(2, 100, worn={COULOMB: ramp(40, -8.0)})
    (grown_away,) = track(grown, limits={COULOMB: 0.5 * LEVELS[0]}).forecasts
    assert grown_away.lower and grown_away.date is None
    assert "lower limit of 2.5 Nm" in grown_away.sentence
    assert "an upper one would be exceeded already" in grown_away.sentence
    (passed,) = track(fallen, limits={COULOMB: LEVELS[0] - 0.3}).forecasts
    assert passed.lower and "beyond it already" in passed.sentence
    assert "upper one" not in passed.sentence
    (ahead,) = track(fallen, limits={COULOMB: LEVELS[0] - 1.5}).forecasts
    assert ahead.lower and ahead.within_95[0] is not None
    assert "its lower limit of 3.5 Nm" in ahead.sentence and "upper one" not in ahead.sentence
    made = track(grown, limits={COULOMB: LEVELS[0] + 1.5})
    assert not made.forecasts[0].lower and "lower" not in made.forecasts[0].sentence
    assert json.loads(made.to_json())["forecasts"][0]["lower"] is False


def test_a_limit_is_also_a_share_of_the_level_at_first() -> None:
    made = track(worn_history(2, 100, worn={COULOMB: ramp(40, 8.0)}), limits={COULOMB: "120%"})
    assert made.forecasts[0].limit == pytest.approx(1.2 * made[COULOMB].at_first[0], rel=0.01)
    assert made.forecasts[0].limit == pytest.approx(1.2 * LEVELS[0], rel=0.03)


def test_what_temperature_explains_is_no_change() -> None:
    warm = np.where(np.arange(80) < 40, 20.0, 30.0) + np.random.default_rng(0).normal(0, 2.0, 80)
    made = track(worn_history(3, per_kelvin=0.05, temperature=warm))
    laws(made)
    assert made.changes == ()
    assert any("goes with temperature" in remark for remark in made.remarks)
    unknown = replace(made.history, temperatures=np.full(80, np.nan))
    assert len(track(unknown).changes) >= 1


def test_a_step_that_temperature_takes_too_is_not_told() -> None:
    """Before it all was cold, behind it all is warm: nobody can tell which it was."""
    warm = np.where(np.arange(80) < 40, 20.0, 30.0)
    made = track(worn_history(3, per_kelvin=0.0, temperature=warm, worn={COULOMB: step(40, 4.0)}))
    assert made.changes == ()


def test_a_change_beside_a_season_is_told_with_its_coefficient() -> None:
    made = track(worn_history(4, 100, worn={COULOMB: step(60, 3.0)}))
    assert [c.causes for c in made.changes] == [(COULOMB,)]
    value, error = made[COULOMB].by_temperature
    assert abs(value - 10.0 * 0.03 * NOISES[0]) < 4.0 * error


def test_one_cause_is_one_change_however_confounded() -> None:
    made = track(worn_history(5, worn={COULOMB: step(45, 1.0)}, correlation=0.99))
    laws(made)
    (change,) = made.changes
    assert change.causes[0] == COULOMB
    assert any("as far as the others stayed" in remark for remark in made.remarks)


def test_what_two_causes_explain_as_well_is_said_not_to_be_known() -> None:
    """The sum of two that only their difference tells: either moves it the same."""
    seeds = range(12)
    made = [
        track(worn_history(seed, worn={COULOMB: step(45, 0.3)}, correlation=0.99)) for seed in seeds
    ]
    open_ones = [c for t in made for c in t.changes if not c.known]
    assert len(open_ones) >= 4
    for change in open_ones:
        assert set(change.causes) <= {COULOMB, LOAD}
        assert "I do not know which" in change.sentence
    limited = next(t for t in made if t.changes and not t.changes[0].known)
    (forecast,) = track(limited.history, limits={COULOMB: 6.0}).forecasts
    assert forecast.date is None
    assert "no date before that is known" in forecast.sentence


def test_two_causes_are_two_changes() -> None:
    worn = {COULOMB: step(30, 3.0), OFFSET: ramp(50, 8.0)}
    made = track(worn_history(6, 110, worn=worn))
    laws(made)
    assert sorted(c.causes for c in made.changes) == [(COULOMB,), (OFFSET,)]
    assert [c.date for c in made.changes] == sorted(c.date for c in made.changes)


@pytest.mark.parametrize("seed", range(3))
def test_two_causes_of_one_day_are_two_changes(seed: int) -> None:
    """The one that is known is not blamed once more for what it does not explain."""
    made = track(worn_history(seed, worn={COULOMB: step(50, 20.0), OFFSET: step(50, 10.0)}))
    laws(made)
    assert sorted(c.causes for c in made.changes) == [(COULOMB,), (OFFSET,)]


@pytest.mark.parametrize("size", [8.0, 200.0])
def test_a_step_far_beyond_the_noise_began_before_the_session_that_reads_it(size: float) -> None:
    """The date lies between the two sessions on its sides, of that day at last, as in 95 %."""
    within = []
    for onset in np.linspace(30.02, 30.98, 13):
        (change,) = track(worn_history(1, 60, worn={COULOMB: step(onset, size)})).changes
        assert week(30) <= change.between[0] < change.between[1] <= week(31 + 1 / 7)
        within.append(change.between[0] <= week(onset) <= change.between[1])
    assert np.mean(within) > 0.9


def test_a_step_near_the_noise_may_have_begun_behind_the_session_that_reads_it() -> None:
    (change,) = track(worn_history(1, worn={COULOMB: step(50, 3.0)})).changes
    assert change.between[1] > week(50 + 1 / 7)


def test_a_single_session_is_an_accident_and_no_change() -> None:
    history = worn_history(7)
    values = history.values.copy()
    values[40] += 12.0 * np.array(NOISES)
    values[-1] += 12.0 * np.array(NOISES)
    made = track(replace(history, values=values))
    assert made.changes == ()


def grown_order(phase: float) -> Track:
    names = ("output_ripple.cosine 2", "output_ripple.sine 2", "offset.offset")
    at = np.array([np.cos(phase), np.sin(phase)])
    return track(
        worn_history(
            8, names=names, levels=(*(10.0 * at), 0.0), noises=(1.0, 1.0, 1.0), units=("Nm",) * 3,
            worn={name: step(50, 3.0 * part) for name, part in zip(names, at, strict=False)},
        )
    )  # fmt: skip


def test_an_order_that_grows_is_told_whatever_its_phase() -> None:
    for phase in (0.0, 1.0, 2.5, 4.0):
        made = grown_order(phase)
        laws(made)
        (change,) = made.changes
        assert change.causes == ("output_ripple, order 2",)
        assert change.parameter == "output_ripple.amplitude 2"
        assert change.size == pytest.approx(3.0, abs=4.0 * change.error)


def test_a_phase_that_may_have_stayed_is_not_told_to_change_with_its_amplitude() -> None:
    """Both are of one cause; the interval of the second's change holds zero."""
    made = grown_order(1.0)
    assert made["output_ripple.amplitude 2"].state == "changed"
    assert made["output_ripple.quadrature 2"].state == "no change told"


def test_wear_that_a_repair_undid_is_told_and_so_is_the_repair() -> None:
    def until_repaired(weeks: np.ndarray) -> np.ndarray:
        return ramp(20, 6.0)(weeks) * (weeks < 70)

    made = track(worn_history(4, 110, worn={COULOMB: until_repaired}))
    laws(made)
    assert [c.causes for c in made.changes] == [(COULOMB,), (COULOMB,)]
    up, down = made.changes
    assert up.size > 0.0 > down.size
    assert down.between[0] <= week(70) <= down.between[1]
    assert "It needs" not in made.verdict


def test_a_session_without_errors_tells_nothing() -> None:
    history = worn_history(1, 30)
    covariance = history.covariance.copy()
    covariance[:, 0] = covariance[:, :, 0] = np.nan
    made = track(replace(history, covariance=covariance))
    laws(made)
    assert made[COULOMB].state == "not known yet"
    assert made[OFFSET].state == "no change told"


@pytest.mark.parametrize("count", [1, 2, LEAST_SESSIONS - 1])
def test_of_few_sessions_nothing_is_known_yet(count: int) -> None:
    made = track(worn_history(9, count), limits={COULOMB: 9.0})
    laws(made)
    assert not made.known
    assert "not known yet" in made.verdict
    assert made.forecasts[0].date is None


@pytest.mark.parametrize("count", [2, 3, 5])
def test_the_error_of_few_sessions_is_that_of_how_they_differ(count: int) -> None:
    """They differ by seven of their measured errors; two of three levels are within the error."""
    within = []
    for seed in range(20):
        history = worn_history(seed, count, per_kelvin=0.0)
        made = track(replace(history, covariance=0.04 * history.covariance))
        laws(made)
        for parameter, truth in zip(made.parameters, LEVELS, strict=True):
            assert parameter.now[0] == pytest.approx(np.median(parameter.band.middle))
            within.append(abs(parameter.now[0] - truth) < parameter.now[1])
    assert np.mean(within) > 0.55  # of 60; 0.68 less two standard errors


def test_two_sessions_leave_open_what_temperature_makes() -> None:
    """0.30 and 0.36 at 15 °C and 32 °C, each with an error of 0.0005."""
    history = worn_history(1, 2, temperature=np.array([15.0, 32.0]))
    values = np.repeat([[0.30], [0.36]], 3, axis=1)
    (own, *_) = track(
        replace(history, values=values, covariance=np.full((2, 3), 0.0005))
    ).parameters
    assert own.now[0] == pytest.approx(0.33, abs=0.01)
    assert own.now[1] > 0.03 and own.at_first[1] > 0.03
    assert np.isnan(own.by_temperature).all()


@pytest.mark.parametrize(("count", "said"), [(LEAST_SESSIONS, True), (LEAST_SESSIONS - 1, False)])
def test_of_enough_sessions_it_is_said_that_temperature_rose_over_them(
    count: int, said: bool
) -> None:
    made = track(worn_history(9, count, temperature=20.0 + np.arange(count)))
    assert any("Temperature rose over these sessions" in r for r in made.remarks) == said


@pytest.mark.parametrize(("count", "told"), [(1, False), (2, False), (3, True), (60, True)])
def test_the_temperature_of_levels_is_told_where_it_is_accounted_for(
    count: int, told: bool
) -> None:
    made = track(worn_history(9, count))
    warm = float(np.median(made.history.temperatures))
    assert np.isfinite(made.reference) == told
    assert (f"Levels are those at {warm:.1f} °C" in str(made)) == told
    assert (f"Levels are those at {warm:.1f} °C" in made._repr_html_()) == told
    assert any("Temperature is not accounted for" in r for r in made.remarks) != told


def test_sessions_of_one_day_are_of_that_day() -> None:
    history = worn_history(9, 3)
    (one, *_) = history.dates
    assert "(3 sessions, 2026-01-05 to 2026-01-19)" in track(history).verdict
    same = replace(history, dates=np.full(3, one))
    assert "(3 sessions, 2026-01-05)" in track(same).verdict
    assert "(1 session, 2026-01-05)" in track(worn_history(9, 1)).verdict


def test_a_bad_day_is_followed_as_a_good_one(recwarn: pytest.WarningsRecorder) -> None:
    """Sessions that are not told, on one day, months apart, without temperature."""
    history = worn_history(10, 90, worn={COULOMB: step(60, 4.0)})
    values, warm = history.values.copy(), history.temperatures.copy()
    values[5] = np.nan
    values[10:20, 2] = np.nan
    warm[[3, 22, 63]] = np.nan
    kept = np.r_[0:30, 45:90]
    worse = replace(history, values=values, temperatures=warm).sessions(kept)
    dates = worse.dates.copy()
    dates[20] = dates[21]
    made = track(replace(worse, dates=dates))
    laws(made)
    assert [c.causes for c in made.changes] == [(COULOMB,)]
    assert any("3 sessions of unknown temperature" in r for r in made.remarks)
    assert any("No session from" in r for r in made.remarks)
    assert not recwarn.list


def test_the_order_of_sessions_units_and_dates_makes_no_difference() -> None:
    history = worn_history(11, worn={LOAD: step(50, 3.0)})
    (change,) = track(history).changes
    order = np.random.default_rng(0).permutation(len(history))
    (shuffled,) = track(history.sessions(order)).changes
    assert shuffled == change
    scaled = replace(history, values=1e3 * history.values, covariance=1e6 * history.covariance)
    (other,) = track(scaled).changes
    assert other.evidence == pytest.approx(change.evidence, rel=1e-6)
    assert other.size == pytest.approx(1e3 * change.size, rel=1e-6)
    (mirrored,) = track(replace(history, values=-history.values)).changes
    assert mirrored.size == pytest.approx(-change.size, rel=0.02)


def test_whether_parameters_are_confounded_does_not_depend_on_their_units() -> None:
    history = worn_history(5, worn={COULOMB: step(45, 1.0)}, correlation=0.99)
    weights = weights_of(history)
    assert np.count_nonzero(weights[0]) == 2
    for unit in (1e-3, 1e3):
        scaled = replace(
            history, values=unit * history.values, covariance=unit**2 * history.covariance
        )
        np.testing.assert_allclose(weights_of(scaled), weights, rtol=1e-6)


def test_the_evidence_over_time_is_nearly_that_of_the_sessions_until_then() -> None:
    """What is usual between neighbours, by which accidents are judged, is that of all sessions."""
    history = worn_history(12, 60, worn={COULOMB: step(40, 2.0)})
    series, _ = history.series(np.eye(3)[0])
    path = evidence_over_time(series)
    assert np.isneginf(path[: LEAST_SESSIONS - 1]).all()
    for count in (8, 15, 25, 26, 40, 45, 60):
        alone = Candidates.of(series.until(count)).evidence[0]
        assert path[count - 1] == pytest.approx(alone, abs=1.0)


def test_the_threshold_grows_with_parameters_and_falls_with_sessions() -> None:
    assert threshold(100, 8) > threshold(100, 1)
    assert threshold(10, 1) > threshold(100, 1)


def test_joints_that_do_not_wear_raise_few_alarms() -> None:
    """Forty joint-years of three parameters in autoregressive noise with tails."""
    rng = np.random.default_rng(5)
    raised = 0
    for _ in range(20):
        noise = rng.standard_t(4, size=(104, 3)) / np.sqrt(2.0)
        for s in range(1, 104):
            noise[s] = 0.4 * noise[s - 1] + np.sqrt(1.0 - 0.4**2) * noise[s]
        for p in range(3):
            series = Series(7.0 * np.arange(104.0), noise[:, p], np.full(104, 0.3))
            needed = [threshold(n, 3) for n in range(1, 105)]
            raised += bool((evidence_over_time(series) > needed).any())
    assert raised <= 9  # more than 9 of a mean of 4: 0.8 %


def test_after_a_service_a_joint_begins_anew() -> None:
    history = worn_history(13, 100, worn={COULOMB: step(40, 4.0)})
    assert track(history).changes
    made = track(history.since("2026-11-01"))
    assert made.changes == ()
    assert made.history.dates[0] >= np.datetime64("2026-11-01")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"limits": {"colomb_friction": 1.0}}, "there is no parameter 'colomb_friction'"),
        ({"limits": {COULOMB: "much"}}, "give a number, or 150%"),
        ({"limits": {COULOMB: np.nan}}, "give a number, or 150%"),
        ({"horizon": 0.0}, "give one above 0"),
    ],
)
def test_a_wrong_call_is_refused_in_a_sentence(wrong: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        track(worn_history(1, 10), **wrong)


def test_an_unknown_limit_names_each_parameter_once_and_none_that_has_no_limit() -> None:
    history = grown_order(1.0).history
    given = worn_history(8, 80, names=("output_ripple.cosine 2", "output_ripple.sine 2", OFFSET))
    with pytest.raises(InputError) as refused:
        track(given, limits={"backlash": 1.0})
    said = str(refused.value)
    assert all(said.count(name) == 1 for name in history.names)
    assert "cosine" not in said


def test_a_history_that_is_none_is_refused() -> None:
    history = worn_history(1, 10)
    for change, said in (
        ({"values": history.values[:5]}, "values of the history are of shape"),
        ({"covariance": -history.covariance}, "a variance of the history is negative"),
        ({"names": ("a.b",) * 3}, "two parameters of the history have one name"),
        ({"dates": np.array(["NaT"] * 10, dtype="M8[s]")}, "has no date"),
    ):
        with pytest.raises(InputError, match=said):
            replace(history, **change)
    with pytest.raises(InputError, match="needs a session and a parameter"):
        History(np.array([], dtype="M8[s]"), (), (), np.empty((0, 0)), np.empty((0, 0)))
    with pytest.raises(InputError, match="no session is from 2100-01-01 on"):
        history.since("2100-01-01")
    with pytest.raises(InputError, match="is no date"):
        history.since("yesterday")
