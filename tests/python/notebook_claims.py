"""What the sentences of a notebook say of its results, as a cell that is run behind the last one.

A sentence that names an effect, counts claims or gives a number has its line here; a change of the
package that makes a sentence wrong then fails the notebook's test. `missing_effect_measured` has
`test_discover_measured`, `mujoco_pendulum` its own assertions.
"""

CLAIMS = {
    "missing_effect": """
assert "below 0.07 rad/s" in where.sentences[1] and "turns with the joint" in where.sentences[1]
assert found.names == ("stribeck_friction", "wave_generator_ripple")
fades = found.fit["stribeck_friction.stribeck_velocity"]
assert abs(fades.value - 0.12) < 3.0 * fades.standard_error and abs(fades.value - 0.12) < 0.005
assert [order for order, _ in found.fit.part.effects[-1].harmonics] == [2]
assert again.names == () and "presliding_friction" in again.withdrawn
assert set(again.unexplained.depends_on) == {"output_velocity", "output_acceleration"}
assert not found.plan
""",
    "missing_effect_ur10e": """
assert found.names == ("load_dependent_friction", "presliding_friction")
first, second = found.found
assert first.indistinguishable_from == ("position_dependent_friction",)
assert second.confidence < first.confidence
springs = [p for p in found.parameters("presliding_friction") if p.unit == "A"]
assert any(p.state == "not determined" for p in springs)
parts = found.before_after()["final"]
near, far = (parts["reversals"][k] for k in ("within ±0.1 s of a reversal", "elsewhere"))
assert 0.7 * far < near < 1.3 * far
""",
    "first_fit": """
assert 4.5 < first.rmse / 0.015 < 6.0
assert {round(one.per_output_turn) for one in orders.found} == {1, 2, 202}
assert "Not significant (95 %): temperature_drift.quadratic." in str(full)
assert largest < 1e-8 and len(turlapati.confounded) == 1
off = table["errors off"].abs()
assert (off.drop(["coulomb_friction.level", "direction_width"]) < 3.0).all()
higher = table.loc["coulomb_friction.level", "value"] - table.loc["coulomb_friction.level", "truth"]
assert 0.015 < higher < 0.025
assert table.loc["direction_width", "value"] < table.loc["direction_width", "truth"]
""",
    "statistics": """
assert 4.5 < (fit.to_frame()["standard_error"] / fit.to_frame()["naive_error"]).median() < 5.5
assert (coverage["interval"] >= 34).all() and (coverage["naive interval"] <= 20).all()
assert (abs(errors["60 s, 400 Hz"][:3] / errors["60 s"][:3] - 1.0) < 0.15).all()
assert (abs(errors["240 s"][:3] / errors["60 s"][:3] - 0.5) < 0.1).all()
assert not short.uncertainty.reliable
assert short.uncertainty.statement.startswith("Intervals are rough")
levels = [one.params["coulomb_friction.level"] for one in (lacking, whole)]
assert levels[0].value - 0.3 > 5.0 * levels[0].stderr
assert abs(levels[1].value - 0.3) < 3.0 * levels[1].stderr
assert found.names == ("stribeck_friction",)
assert len(swung.confounded) == 1 and "gravity.cosine" in swung.confounded[0].sentence
assert len(profile.parts) == 2 and profile.interval[1] > 3.0 * profile.wald[1]
assert pooled.rmse > 1.5 * each.rmse
assert not scan.found
""",
    "certificate": """
loaded = subprocess.run(f"./loader {blocks}", shell=True, capture_output=True, text=True).stdout
status = [line.split("status ")[1].split(",")[0] for line in loaded.splitlines()]
assert "0" not in status[:3] and status[3] == "0"
""",
    "own_effect": """
assert found.names == ("lip_seal",)
for name, truth in (("lip_seal.most", 0.2), ("lip_seal.lift", 0.6)):
    own = found.fit[name]
    assert abs(own.value - truth) < 3.0 * own.standard_error
(first,) = found.found
rival = first.rivals[0]
assert rival.name == "stribeck_friction" and 0.4 < rival.gain / rival.own < 0.6
assert certificate.bit_identical and certificate.outputs[0].quantisation < 1e-6
import pathlib
assert {path.name for path in pathlib.Path("controller").iterdir()} == {"joint.hpp", "lip_seal.hpp"}
""",
    "mujoco_plugin": """
assert apart <= 1e-12 and len(seen) > 3000
built, lugre, plugin = np.array(rows)
assert (plugin < built).tolist() == [False, True, True, True]
assert np.argmax(built - plugin) == 3 and plugin[0] - built[0] < 10.0
assert both[0] > 60.0 and both[2] < 45.0
assert both[2] < 0.6 * min(both[:2]) and (plugin <= lugre).all()
assert 1.4 < fitted[0] - fitted[1] < 1.6 and both[1] > both[0] + 1.0
assert np.argmax(lugre) == 3 and lugre[3] > 100.0
assert held_out[0]["enabled"].min() == 0.0
assert left["plugin"] < 0.3 * left["one stiffness"] and len(load) == len(measured)
assert coupling.largest_load == coupling.fitted_load
""",
    "turlapati": """
assert fit.confounded and len(fit.confounded[0].known) == 2
passed = made.story.tables["lowpass"]["first-order filter passes"]
assert [round(100.0 * (1.0 - share)) for share in passed] == [16, 47]
after = made.story.tables["bearing"]["after [%]"]
assert (after[["trial 1", "trial 2", "trial 3"]] < 11.0).all()
bad = made.claims[made.claims["verdict"] == "does not hold"]["claim"]
words = ("full rank", "are recovered", "inertial torque", "low pass")
assert [sum(word in claim for claim in bad) for word in words] == [1, 1, 1, 1] and len(bad) == 4
""",
    "zhang": """
assert (paper.claims["verdict"] == "does not hold").sum() == 6
assert dear
left = tables["drift_methods"]["RMSE [Nm]"]
assert left.idxmin() == "polynomial of degree 2"
""",
    "measured_logs": """
found_orders = {round(order.per_output_turn) for order in ripple.orders.found}
assert {1800, 3600, 47, 100, 200, 400} <= found_orders and not {300, 600} & found_orders
kept = {order for e in ripple.part.effects for order, _ in e.harmonics}
assert {12, 14, 7, 24, 18, 36} <= kept and not {47, 1, 2, 4} & kept
assert sorted(range(1, 13), key=lambda k: -amplitude[k - 1])[:3] == [8, 2, 4]
moving = table["moving [A]"]
assert moving[2, "load"] < 0.4 * moving[2, "base"]
assert abs(moving[4, "load"] / moving[4, "base"] - 1.0) < 0.03
assert abs(held_out - 0.114) < 0.002
assert servo_table["off the law, RMS"].max() < 24.5e-3
assert servo_table["with 2.1 ms, RMS"].max() < 5.6e-3
""",
    "full_range": """
assert round(measured / 15548, 2) == 1.81
assert 0.0 < table.improvement("m1", "o") < table.improvement("m2", "o")
transitions = [made.transitions[name].transition_velocity for name in ("m1", "m2")]
assert 0.001 < transitions[0] < transitions[1] < 0.05
assert held.sum() == 100
assert same
shown = claims.story.tables["table3"]["ours"]
assert shown["order 200: amplitude"] > shown["order 2: amplitude"] > shown["order 4: amplitude"]
assert shown["order 404: amplitude"] < shown["order 202: amplitude"] < 1.0
""",
    "fleet": """
assert len(set(workers.values()) - set(left.values())) == 1
assert set(made.changed) == set(WORN) and len(made.quiet) == 17 and not made.failed
causes = {"coulomb": "coulomb_friction.level", "load": "load_dependent_friction.factor",
          "zero": "offset.offset"}
for joint, (what, since, _) in WORN.items():
    (change,) = made[joint].changes
    assert change.parameter == causes[what]
    onset = date(2026, 1, 5) + timedelta(days=EVERY * since)
    assert change.between[0].date() <= onset + timedelta(days=EVERY)
    assert onset - timedelta(days=EVERY) <= change.between[1].date()
assert same and set(WORN) < set(alone.tracks) and len(alone.tracks) == 8
assert made["joint07"].forecasts[0].date is not None
""",
}
