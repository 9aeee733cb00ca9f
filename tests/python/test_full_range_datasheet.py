"""Compliance from a catalogue (c1) and from a stiffness run (c2)."""

from __future__ import annotations

from typing import Any

import full_range_logs as rigs
import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.full_range import (
    GearCompliance,
    compliance_from_datasheet,
    fit_kinematic_error,
    fit_mesh_stiffness,
    mesh_of,
    torsion_part,
    torsion_part_from_datasheet,
    with_mesh_stiffness,
)
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.part import Part

SIZE_20: dict[str, Any] = {
    "K1": 1.6e4, "K2": 2.5e4, "K3": 2.9e4, "T1": 7.0, "T2": 25.0,
    "lost_motion": 2.91e-4, "gear_ratio": 100.0,
}  # fmt: skip


def part(**changed: Any) -> Part:
    return torsion_part_from_datasheet(**{**SIZE_20, "output_spline": "circular", **changed})


def test_the_catalogue_of_size_20_gives_table_iii_to_every_digit_printed() -> None:
    made = compliance_from_datasheet(**SIZE_20)
    assert f"{made.mesh_stiffness:.0f}" == "15548"
    assert f"{made.mesh_shape:.4f}" == "0.0487"
    assert f"{made.wave_generator_stiffness:.4f}" == "21.9931"
    assert f"{made.wave_generator_shape:.4f}" == "3.1250"


def test_other_readings_do_not_give_the_wave_generator_s_printed_stiffness() -> None:
    for changed in ({"gear_ratio": 101.0}, {"lost_motion": np.pi / 180.0 / 60.0}):
        made = compliance_from_datasheet(**{**SIZE_20, **changed})
        assert f"{made.wave_generator_stiffness:.4f}" != "21.9931"


def test_the_local_stiffness_is_the_catalogue_s_in_the_middle_of_both_ranges() -> None:
    made = compliance_from_datasheet(**SIZE_20)
    for torque, stiffness in ((3.5, 1.6e4), (16.0, 2.5e4)):
        local = made.mesh_stiffness * (1.0 + (made.mesh_shape * torque) ** 2)
        assert local == pytest.approx(stiffness, rel=1e-12)


def test_an_outward_torque_lets_the_motor_run_ahead() -> None:
    torque = np.array([-10.0, -1.0, 0.0, 1.0, 10.0])
    log = Log.from_arrays(time=np.arange(5.0), reference_torque=torque, motor_torque=torque / 101.0)
    model = Model({"torsion": part()}, {"gear_ratio": 100.0, "output_spline": "circular"})
    torsion = model.predict(log).predicted
    assert np.all(np.sign(torsion) == -np.sign(torque))
    for side in (slice(2, None), slice(2, None, -1)):  # loading stores energy either way
        assert -np.trapezoid(torque[side], torsion[side]) > 0.0


def test_the_first_and_the_second_set_differ_in_the_mesh_alone() -> None:
    first = part()
    second = with_mesh_stiffness(first, 26431.0, 101.0)
    assert mesh_of(second, 101.0).stiffness == pytest.approx(26431.0, rel=1e-12)
    ratio = first.coefficients / second.coefficients
    np.testing.assert_allclose(ratio, [26431.0 / 15547.6923, 1.0], rtol=1e-7)
    assert first.effects == second.effects


def test_a_stiffness_run_gives_the_stiffness_and_leaves_the_rest() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(4000) / 200.0
    load = 8.0 * np.sin(2.0 * np.pi * time / 10.0)
    shape = mesh_of(part(), 101.0).shape
    torsion = -101.0 * np.arctan(shape * load) / (shape * 26431.0)
    log = Log.from_arrays(
        facts={**rigs.FACTS, "name": "brake"},
        time=time,
        output_position=torsion / 101.0 + rng.normal(0.0, 2e-6, len(time)),
        motor_position=np.zeros(len(time)),
        motor_torque=np.zeros(len(time)),
        reference_torque=load,
    )
    fitted = fit_mesh_stiffness(part(), log, checks=False)
    found = mesh_of(fitted.part, 101.0)
    error = fitted["mesh_compliance.compliance"].standard_error
    slack = 4.0 * error / fitted["mesh_compliance.compliance"].value
    assert found.stiffness == pytest.approx(26431.0, rel=slack)
    assert slack < 2e-3 and found.shape == shape


def test_a_kinematic_error_is_fitted_around_a_compliance_that_stays() -> None:
    logs = [rigs.rig(seed, extra=False).log for seed in range(3)]
    kept = torsion_part(rigs.GEAR, rigs.RATIO)
    orders = {"kinematic_error": list(rigs.ERROR)}
    fitted = fit_kinematic_error(kept, logs, orders=orders, checks=False)
    assert mesh_of(fitted.part, rigs.RATIO).stiffness == pytest.approx(26431.0, rel=1e-12)
    for (order, _), size in rigs.ERROR.items():
        del order
        cosines = [p for p in fitted.parameters if p.name.startswith("kinematic_error.cosine")]
        sines = [p for p in fitted.parameters if p.name.startswith("kinematic_error.sine")]
        sizes = [np.hypot(c.value, s.value) for c, s in zip(cosines, sines, strict=True)]
        assert min(abs(found / size - 1.0) for found in sizes) < 0.1


def test_a_catalogue_that_makes_no_sense_is_refused_in_one_sentence() -> None:
    for changed, said in (
        ({"K1": 0.0}, "K1 = 0; give a value above zero"),
        ({"lost_motion": float("nan")}, "lost_motion = nan"),
        ({"T2": 5.0}, "T2 = 5 Nm is not above T1 = 7 Nm"),
        ({"K2": 1.5e4}, "does not stiffen"),
        ({"K2": 9e5, "K3": 1e6}, "does not stiffen"),
        ({"output_spline": "round"}, "give 'circular' or 'flex'"),
    ):
        with pytest.raises(InputError, match=said):
            part(**changed)


def test_a_part_without_a_mesh_is_refused_in_one_sentence() -> None:
    with pytest.raises(InputError, match="has no mesh_compliance"):
        mesh_of(Part("torsion", (), np.array([])), 101.0)
    wrong = torsion_part(GearCompliance(-1.0, 0.05, 22.0, 3.0), 101.0)
    with pytest.raises(InputError, match="must be above zero"):
        mesh_of(wrong, 101.0)
    with pytest.raises(InputError, match="give a stiffness above zero"):
        with_mesh_stiffness(part(), 0.0, 101.0)
