"""Several parameters that change at one date: each with its own size, or all by one share."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from worn_joints import NAMES, ramp, step, worn_history

from flexspline.tracking import History, Track, TrackedParameter, track
from flexspline.tracking.attribution import SCALE, moved
from flexspline.tracking.changes import Shape

COULOMB, VISCOUS, GRAVITY, INERTIA = JOINT = (
    "coulomb_friction.level", "viscous_friction.viscosity", "gravity.amplitude", "inertia.inertia",
)  # fmt: skip
LEVELS = (6.0, 8.0, 12.0, 1.2)
ERRORS = (0.1, 0.14, 0.1, 0.03)  # of a session
TENTH = {
    name: 0.1 * level / error for name, level, error in zip(JOINT, LEVELS, ERRORS, strict=True)
}
UNITS = ("Nm", "Nm·s/rad", "Nm", "kg·m²")


def joint(seed: int, *names: str, sessions: int = 30, share: float = 1.0) -> History:
    """Weekly sessions in which these parameters rise at once by a tenth in the sixteenth.

    Each run confounds Coulomb and viscous friction, as one without slow motion does.
    """
    return worn_history(
        seed, sessions, names=JOINT, levels=LEVELS, noises=ERRORS, units=UNITS, correlation=-0.95,
        per_kelvin=0.0, worn={name: step(15, share * TENTH[name]) for name in names},
    )  # fmt: skip


def step_of(parameter: TrackedParameter) -> tuple[float, float]:
    """By how much the table says that a parameter changed."""
    error = float(np.hypot(parameter.at_first[1], parameter.now[1]))
    return parameter.now[0] - parameter.at_first[0], error


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("pair", [(COULOMB, VISCOUS), (VISCOUS, GRAVITY), (COULOMB, INERTIA)])
def test_two_that_change_at_one_date_are_two_changes_each_with_its_size(
    seed: int, pair: tuple[str, str]
) -> None:
    made = track(joint(seed, *pair))
    assert {c.parameter for c in made.changes} == {*pair}
    assert all(c.known for c in made.changes)
    for change in made.changes:
        truth = 0.1 * LEVELS[JOINT.index(change.parameter)]
        assert abs(change.size - truth) < 4.0 * change.error
        said, error = step_of(made[change.parameter])
        assert abs(change.size - said) < 2.0 * np.hypot(change.error, error)
    assert not any("goes with temperature" in remark for remark in made.remarks)


@pytest.mark.parametrize("name", JOINT)
def test_one_that_changes_is_one_change_beside_which_nothing_is_told(name: str) -> None:
    """Of ten joints; a further cause of one by chance is one change in 200, as of any history."""
    for seed in range(10):
        made = track(joint(seed, name))
        (change,) = made.changes
        assert change.causes[0].partition(".")[0] == name.partition(".")[0]
        truth = 0.1 * LEVELS[JOINT.index(name)]
        assert abs(change.size - truth) < 4.0 * change.error


@pytest.mark.parametrize("seed", range(6))
def test_all_by_one_share_is_one_change_of_the_torque(seed: int) -> None:
    made = track(joint(seed, *JOINT))
    (change,) = made.changes
    assert change.causes == (SCALE,) and change.scaled and change.known
    error = change.relative * change.error / change.size
    assert abs(change.relative - 0.1) < 4.0 * error
    assert error < 0.01
    assert "The torque as a whole rose at once by" in change.sentence
    assert "a look at its torque constant and current sensor" in made.verdict
    assert not any("as far as the others stayed" in remark for remark in made.remarks)
    assert {p.state for p in made.parameters} == {"changed"}
    (saved,) = json.loads(made.to_json())["changes"]
    assert saved["causes"] == [SCALE] and saved["relative"] == pytest.approx(change.relative)


def test_the_share_of_the_torque_has_the_sign_of_what_it_did() -> None:
    (change,) = track(joint(1, *JOINT, share=-1.0)).changes
    assert change.relative == pytest.approx(-0.1, abs=0.01)
    assert "The torque as a whole fell at once by" in change.sentence
    turned = joint(1, *JOINT)
    turned = replace(turned, values=-turned.values)
    (other,) = track(turned).changes
    assert other.relative == pytest.approx(0.1, abs=0.01)


def test_friction_that_changes_by_one_share_alone_is_no_change_of_the_torque() -> None:
    """Its lubricant explains that as well, whether or not what it carries is in the model."""
    history = joint(2, COULOMB, VISCOUS)
    for made in (track(history), track(history.only([0, 1]))):
        assert not any(change.scaled for change in made.changes)


def test_different_shares_are_no_change_of_the_torque() -> None:
    worn = {name: step(15, share * TENTH[name]) for name, share in
            zip(JOINT, (1.0, -1.0, 2.0, 1.0), strict=True)}  # fmt: skip
    made = track(
        worn_history(
            3, 30, names=JOINT, levels=LEVELS, noises=ERRORS, units=UNITS, per_kelvin=0.0, worn=worn
        )
    )
    assert len(made.changes) == 4
    assert not any(change.scaled for change in made.changes)


@pytest.mark.parametrize("seed", range(4))
def test_two_that_wear_together_are_two_changes(seed: int) -> None:
    wear = {COULOMB: ramp(15, 4.0 * TENTH[COULOMB]), VISCOUS: ramp(15, 4.0 * TENTH[VISCOUS])}
    made = track(
        worn_history(
            seed, 50, names=JOINT, levels=LEVELS, noises=ERRORS, units=UNITS, correlation=-0.95,
            per_kelvin=0.0, worn=wear,
        )
    )  # fmt: skip
    assert {c.parameter for c in made.changes} == {COULOMB, VISCOUS}
    for change in made.changes:
        truth = 0.4 * LEVELS[JOINT.index(change.parameter)] * (49.0 - 15.0) / 52.18
        assert abs(change.size - truth) < 4.0 * change.error


def test_a_size_that_the_parameter_itself_contradicts_is_not_told_of_a_sum() -> None:
    """Viscous friction moves by too little to be told, and by enough to move the sum of both.

    It moves the sum by 0.1 Nm, three errors of how far sum and parameter lie from each other: more
    than two of them in five joints of six. Where all sizes were of the sum, none of them was right.
    """
    worn = {COULOMB: step(15, TENTH[COULOMB]), VISCOUS: step(15, 1.2)}
    right = 0
    for seed in range(12):
        history = worn_history(
            seed, 30, names=JOINT, levels=LEVELS, noises=ERRORS, units=UNITS, correlation=-0.95,
            per_kelvin=0.0, worn=worn,
        )  # fmt: skip
        (change,) = [c for c in track(history).changes if c.parameter == COULOMB]
        own = moved(history, 0, Shape("step", 7.0 * 15), ())
        assert abs(change.size - own.size) < 2.0 * np.hypot(change.error, own.error)
        right += abs(change.size - 0.6) < 3.0 * change.error
    assert right >= 8  # of 10 in the mean


def test_only_what_temperature_explains_is_said_to_go_with_it() -> None:
    """A change of a parameter that temperature does not move is no work of temperature's."""
    warm = np.where(np.arange(80) < 40, 20.0, 30.0) + np.random.default_rng(0).normal(0, 2.0, 80)

    def said(made: Track) -> bool:
        return any("goes with temperature" in remark for remark in made.remarks)

    assert said(track(worn_history(3, per_kelvin=0.05, temperature=warm)))
    assert not said(track(worn_history(3, per_kelvin=0.0, temperature=warm)))
    for seed in range(6):
        assert not said(track(joint(seed, COULOMB, VISCOUS)))


def test_what_changed_beside_what_shows_it_best_has_a_sentence() -> None:
    names = ("output_ripple.cosine 2", "output_ripple.sine 2", "offset.offset")
    worn = {names[0]: step(50, 4.0), names[1]: step(50, 3.0)}
    made = track(
        worn_history(8, names=names, levels=(10.0, 0.0, 0.0), noises=(1.0, 1.0, 1.0),
                     units=("Nm",) * 3, worn=worn)
    )  # fmt: skip
    (change,) = made.changes
    (other,) = (p for p in made.parameters if p.state == "changed" and p.name != change.parameter)
    assert other.sentence in made.sentences
    assert other.sentence.endswith(" Nm.") and "at first" in other.sentence


@pytest.mark.parametrize(("sessions", "dated"), [(60, False), (100, False), (110, True)])
def test_without_temperature_wear_has_a_date_from_a_second_year_on(
    sessions: int, dated: bool
) -> None:
    """105 weeks are two years: before, the year's warmth looks like wear."""
    history = worn_history(2, sessions, worn={NAMES[0]: ramp(10, 8.0)}, per_kelvin=0.0)
    limits = {NAMES[0]: "150%"}
    cold = replace(history, temperatures=np.full(sessions, np.nan))
    (forecast,) = track(cold, limits=limits).forecasts
    assert (forecast.date is not None) == dated
    assert ("do not tell wear from a season" in forecast.sentence) != dated
    (known,) = track(history, limits=limits).forecasts
    assert known.date is not None
