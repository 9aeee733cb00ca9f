"""A joint of an MJCF file or a URDF as a model to start from, and what is refused of an XML."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas
import pytest
from cli_calls import call
from undrawn import undrawn

from flexspline.effects import effect
from flexspline.errors import FlexsplineWarning, InputError
from flexspline.exporting import export
from flexspline.joint_file import LARGEST, read_joint
from flexspline.logs.log import Log
from flexspline.model import Model, Part

MJCF = """<mujoco>
  <default>
    <joint damping="0.5" armature="0.01"/>
    <default class="small"><joint frictionloss="0.2"/>
      <default class="smaller"><joint damping="0.125 0.25 -0.5"/></default>
    </default>
  </default>
  <worldbody>
    <body><freejoint name="free"/><geom size="1"/></body>
    <body><joint name="usual"/><geom size="1"/></body>
    <body childclass="small">
      <joint name="shoulder"/><geom size="1"/>
      <body><joint name="elbow" class="smaller" armature="0.03"/><geom size="1"/>
        <frame childclass="main">
          <body><joint name="wrist" damping="0"/><geom size="1"/></body>
        </frame>
      </body>
      <joint name="rail" type="slide"/>
    </body>
  </worldbody>
  <equality><joint joint1="elbow"/></equality>
</mujoco>"""
URDF = """<?xml version="1.0"?>
<robot name="r">
  <joint name="base" type="fixed"/>
  <joint name="elbow" type="revolute"><dynamics damping="0.3" friction="0.4"/></joint>
  <joint name="bare" type="continuous"/>
  <transmission><joint name="elbow"/></transmission>
</robot>"""


def written(folder: Path, text: str | bytes, name: str = "joint.xml") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def values_of(model: Model) -> dict[str, list[float]]:
    """Coefficients by effect."""
    (part,) = model.parts.values()
    found, first = {}, 0
    for one in part.effects:
        found[one.name] = part.coefficients[first : first + len(one.terms)].tolist()
        first += len(one.terms)
    return found


@pytest.mark.parametrize(
    ("joint", "armature", "damping", "friction"),
    [
        ("usual", 0.01, (0.5,), 0.0),
        ("shoulder", 0.01, (0.5,), 0.2),
        ("elbow", 0.03, (0.125, 0.25, -0.5), 0.2),
        ("wrist", 0.01, (0.0,), 0.0),
    ],
)
def test_joints_of_an_mjcf_have_what_mujoco_gives_them(
    joint: str, armature: float, damping: tuple[float, ...], friction: float, tmp_path: Path
) -> None:
    made = read_joint(written(tmp_path, MJCF), joint)
    assert (made.armature, made.damping, made.friction) == (armature, damping, friction)


def test_defaults_are_those_of_mujoco(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    loaded = mujoco.MjModel.from_xml_string(MJCF)
    for name in ("usual", "shoulder", "elbow", "wrist"):
        mine = read_joint(written(tmp_path, MJCF), name)
        at = loaded.joint(name)
        assert mine.armature == at.armature[0] and mine.friction == at.frictionloss[0]
        assert mine.damping[0] == at.damping[0]


def test_a_urdf_gives_friction_of_a_torque_at_the_output(tmp_path: Path) -> None:
    model = Model.load(written(tmp_path, URDF, "r.urdf"), joint="elbow")
    assert list(model.parts) == ["drive"] and model.part().target == "motor_torque"
    assert values_of(model) == {"viscous_friction": [0.3], "coulomb_friction": [0.4]}
    assert model.facts == {"joint": "elbow"}
    bare = Model.load(tmp_path / "r.urdf", joint="bare", target="sensor_torque")
    assert list(bare.parts) == ["sensor"] and values_of(bare) == {}


def test_a_joint_goes_out_and_comes_back(tmp_path: Path) -> None:
    names = ("inertia", "viscous_friction", "nonlinear_viscous_friction", "coulomb_friction")
    numbers = np.array([0.02, 0.1 + 0.2, -0.02, 0.001, 0.4])
    part = Part("motor_torque", tuple(map(effect, names)), numbers)
    path = export(Model({"drive": part}, {"joint": 'a"<-->&'}), tmp_path / "j.xml", "mujoco")
    back = Model.load(path)
    assert back.part().coefficients.tolist() == numbers.tolist()
    assert back.part().effects == part.effects and back.facts == {"joint": 'a"<-->&'}
    back.save(tmp_path / "model.json")
    assert values_of(Model.load(tmp_path / "model.json")) == values_of(back)


def test_an_xml_is_told_by_its_first_letter_too(tmp_path: Path) -> None:
    text = b"\xef\xbb\xbf\n" + URDF.split("\n", 1)[1].encode()
    assert values_of(Model.load(written(tmp_path, text, "robot.txt"), joint="elbow"))


ONE = '<mujoco><worldbody><body><joint name="a" {}/></body></worldbody></mujoco>'
TWO = '<robot><joint name="a" type="revolute"/><joint name="{}" type="revolute"/></robot>'
BOMB = '<!DOCTYPE r [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><robot><joint name="&b;"/></robot>'


@pytest.mark.parametrize(
    ("text", "joint", "sentence"),
    [
        (TWO.format("a"), "a", "two joints of the name 'a'; rename one"),
        (TWO.format("b"), None, r"several joints; say which \(--model-joint\): a, b"),
        (TWO.format("elbow"), "elbw", r"no joint 'elbw' \(did you mean 'elbow'\?\); .*: a, elbow"),
        (ONE.format('damping="-0.1"'), None, "damping = '-0.1' is negative"),
        (ONE.format('frictionloss="-1"'), None, "frictionloss = '-1' is negative"),
        (ONE.format('armature="-1e-9"'), None, "armature = '-1e-9' is negative"),
        (ONE.format('damping="much"'), None, "damping = 'much' is no number"),
        (ONE.format('damping="1_0"'), None, "damping = '1_0' is no number"),
        (ONE.format('damping=""'), None, "damping = '' is not one to 3 finite numbers"),
        (ONE.format('damping="1 2 3 4"'), None, "not one to 3 finite numbers"),
        (ONE.format('damping="nan"'), None, "not one to 3 finite numbers"),
        (ONE.format('armature="1 2"'), None, "armature = '1 2' is not a finite number"),
        (ONE.format('armature="1e999"'), None, "not a finite number"),
        (ONE.format('class="lost"'), None, "class 'lost', which no default has"),
        (ONE.format('type="slide"'), None, "type 'slide', and flexspline has those that turn"),
        ("<mujoco><worldbody/></mujoco>", None, "has no joint that moves"),
        ('<robot><joint name="a" type="fixed"/></robot>', None, "has no joint that moves"),
        (MJCF[:-30], "elbow", "is no whole XML .* line"),
        ("", None, "is no whole XML"),
        ("{}", None, "is no whole XML"),
        ("<robot>&lost;</robot>", None, "is no whole XML"),
        ('<?xml version="1.0" encoding="martian"?><robot/>', None, "is no whole XML"),
        (b"<robot name='\xff\xfe'/>", None, "is no whole XML"),
        (b"<robot>\x00</robot>", None, "is no whole XML"),
        (BOMB, None, "has a DOCTYPE or declares entities"),
        ('<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot/>', None, "has a DOCTYPE"),
        ('<mujoco><include file="a.xml"/></mujoco>', None, "includes another file"),
        ('<mujoco><worldbody><include file="/etc/x"/></worldbody></mujoco>', None, "includes"),
        ("<html><body/></html>", None, "begins with <html>; give an MJCF file or a URDF"),
        ("<a>" * 5000, None, "nested too deep"),
        (MJCF, "rail", "type 'slide', and flexspline has those that turn"),
        (MJCF, "free", "has no joint 'free'"),
        ("<robot>" + " " * LARGEST + "</robot>", None, "larger than 16 MiB"),
    ],
)
def test_bad_files_get_one_sentence(
    text: str | bytes, joint: str | None, sentence: str, tmp_path: Path
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=sentence) as caught:
        Model.load(path, joint=joint)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_a_file_that_is_not_there_and_a_target_that_is_no_torque(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"joint\.xml: cannot be read"):
        Model.load(tmp_path / "joint.xml")
    path = written(tmp_path, ONE.format(""))
    with pytest.raises(InputError, match="torque at the output, and the target is motor_current"):
        Model.load(path, target="motor_current")


def runs_of(folder: Path, level: float) -> list[Path]:
    """Runs of a sensor: inertia, viscous and Coulomb friction, and that much gravity."""
    paths = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        time = np.arange(4000) / 200.0
        phases, paces = random.uniform(0, 6, 4), np.array([0.31, 0.73, 1.37, 2.3])
        angle = np.sin(time[:, None] * paces + phases) @ [1.0, 0.5, 0.3, 0.1]
        speed = np.cos(time[:, None] * paces + phases) * paces @ [1.0, 0.5, 0.3, 0.1]
        turn = -np.sin(time[:, None] * paces + phases) * paces**2 @ [1.0, 0.5, 0.3, 0.1]
        log = Log.from_arrays(
            time=time, output_position=angle, output_velocity=speed, output_acceleration=turn
        )
        names = ("inertia", "viscous_friction", "coulomb_friction", "gravity")
        numbers = np.array([0.05, 0.3, 0.4, level, 0.0])
        part = Part("sensor_torque", tuple(map(effect, names)), numbers)
        torque = Model({"sensor": part}).predict(log).predicted + random.normal(0, 0.01, len(time))
        frame = log.to_frame().assign(sensor_torque=torque)
        paths.append(folder / f"run{seed}.csv")
        frame.to_csv(paths[-1], index=False)
    return paths


@pytest.mark.usefixtures("undrawn")
def test_discover_says_what_a_urdf_lacks(tmp_path: Path) -> None:
    runs, path = runs_of(tmp_path, 0.8), written(tmp_path, URDF.replace('"bare"', '"other"'))
    given = ("--model", path, "--model-joint", "elbow", "--target", "sensor_torque")
    done = call("discover", *runs, *given, "--fix", "viscosity=0.3", "--out", tmp_path / "found")
    assert done.exit_code == 0, done.stderr
    made = json.loads((tmp_path / "found" / "discovery.json").read_text())
    assert made["base_effects"] == ["viscous_friction", "coulomb_friction"]
    assert {"gravity", "inertia"} <= {one["effect"] for one in made["found"]}
    extended = Model.load(tmp_path / "found" / "model.json")
    assert values_of(extended)["viscous_friction"] == [0.3]
    wrong = call("discover", *runs, *given[:2], *given[4:], "--out", tmp_path / "new")
    assert wrong.exit_code == 2 and "(--model-joint): elbow, other" in wrong.stderr
    assert not (tmp_path / "new").exists()


@pytest.mark.usefixtures("undrawn")
def test_predict_and_compare_take_the_numbers_of_the_file(tmp_path: Path) -> None:
    (run, *_), path = runs_of(tmp_path, 0.0), written(tmp_path, URDF)
    given = ("--model", path, "--model-joint", "elbow", "--target", "sensor_torque")
    assert call("predict", run, *given, "--out", tmp_path / "p.csv").exit_code == 0
    predicted = np.genfromtxt(tmp_path / "p.csv", delimiter=",", names=True)["predicted"]
    speed = np.genfromtxt(run, delimiter=",", names=True)["output_velocity"]
    fast = np.abs(speed) > 0.1
    assert predicted[fast] == pytest.approx((0.3 * speed + 0.4 * np.sign(speed))[fast], abs=1e-9)
    done = call("compare", run, *given, "--out", tmp_path / "where")
    assert done.exit_code == 0, done.stderr


SPRUNG = ONE.format('damping="0.5" {}')


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('stiffness="5" springref="0.5"', r"its spring \(stiffness 5, springref 0.5\) is left out"),
        ('stiffness="0 1.5"', r"its spring \(stiffness 0 1.5, springref 0\) is left out"),
        ('stiffness="-2"', r"its spring \(stiffness -2, springref 0\) is left out"),
    ],
)
def test_a_spring_is_left_out_in_one_sentence(text: str, said: str, tmp_path: Path) -> None:
    path = written(tmp_path, SPRUNG.format(text))
    with pytest.warns(FlexsplineWarning, match=said) as caught:
        model = Model.load(path)
    assert values_of(model) == {"viscous_friction": [0.5]} and len(caught) == 1
    done = call("export", "--model", path, "--format", "json", "--out", tmp_path / "model.json")
    assert done.exit_code == 0 and done.stderr.count("is left out") == 1
    assert done.stderr.startswith(f"flexspline: warning: {path}: joint 'a': its spring")


MOTORS = """<actuator>
    <dcmotor joint="a" input="none" motorconst="0 0" resistance="1" lugre="10 0 0 0.2  0.3"/>
    <dcmotor class="c" jointinparent="a" motorconst="1 1" resistance="1" lugre="0 0 0 0 0"/>
    <motor joint="a" gear="2" armature="0.01"/><motor joint="b" damping="3"/>
    <motor tendon="a" damping="1"/><motor joint="a" damping="0.0"/>
  </actuator>"""


def test_what_actuators_add_to_a_joint_is_left_out_in_one_sentence(tmp_path: Path) -> None:
    classed = '<default><default class="c"><dcmotor cogging="0.1 12 0"/></default></default>'
    text = ONE.format('damping="0.5"').replace("</mujoco>", f"{classed}{MOTORS}</mujoco>")
    path = written(tmp_path, text)
    said = r"\(dcmotor lugre 10 0 0 0.2 0.3, dcmotor cogging 0.1 12 0, motor armature 0.01\); let"
    with pytest.warns(FlexsplineWarning, match=said) as caught:
        model = Model.load(path)
    assert values_of(model) == {"viscous_friction": [0.5]} and len(caught) == 1


def test_a_file_of_ours_with_dcmotors_is_a_model_of_its_numbers(tmp_path: Path) -> None:
    effects = (effect("inertia"), effect("stribeck_friction"), effect("cogging", orders=[2]))
    part = Part("motor_torque", effects, np.array([0.02, 0.3, 0.1, 0.2]))
    path = export(
        Model({"drive": part}, {"gear_ratio": 100.0}), tmp_path / "j.xml", "mujoco", dcmotor=True
    )
    with pytest.warns(FlexsplineWarning, match="dcmotor lugre .*, dcmotor cogging .* let disc"):
        assert values_of(Model.load(path))["inertia"] == [0.02]


@pytest.mark.filterwarnings("error")
def test_a_joint_without_a_spring_says_nothing(tmp_path: Path) -> None:
    for text in ("", 'stiffness="0"', 'springref="0.5"', 'stiffness="0 0 0" springref="-1"'):
        assert values_of(Model.load(written(tmp_path, SPRUNG.format(text))))


def test_a_spring_that_is_no_number_is_refused(tmp_path: Path) -> None:
    for text, sentence in (
        ('stiffness="soft"', "stiffness = 'soft' is no number"),
        ('stiffness="nan"', "stiffness = 'nan' is not one to 3 finite numbers"),
        ('stiffness="1" springref="0 1"', "springref = '0 1' is not a finite number"),
    ):
        with pytest.raises(InputError, match=sentence):
            Model.load(written(tmp_path, SPRUNG.format(text)))


def robot_of(folder: Path) -> tuple[Path, Path, Path]:
    """A recording of two joints with other friction, its map, and the URDF of the robot."""
    frames = {}
    for name, level in (("shoulder", 0.4), ("elbow", 0.8)):
        frame = pandas.read_csv(runs_of(folder, 0.0)[0])
        speed = frame["output_velocity"]
        frame["sensor_torque"] = 0.3 * speed + level * np.tanh(speed / 1e-3)
        frames[name] = frame
    columns = {"t": frames["elbow"]["time"]}
    for name, frame in frames.items():
        columns |= {f"q_{name}": frame["output_position"], f"w_{name}": frame["output_velocity"]}
        columns[f"tau_{name}"] = frame["sensor_torque"]
    pandas.DataFrame(columns).to_csv(folder / "robot.csv", index=False)
    names = {"time": "t", "output_position": "q", "output_velocity": "w", "sensor_torque": "tau"}
    rows = (f"{k} = '{v}'" if v == "t" else f"{k} = '{v}_{{joint}}'" for k, v in names.items())
    (folder / "map.toml").write_text("\n".join(["[columns]", *rows]))
    text = URDF.replace('"bare" type="continuous"/>', '"shoulder" type="continuous"/>')
    return folder / "robot.csv", folder / "map.toml", written(folder, text, "robot.urdf")


def test_each_joint_of_a_robot_is_predicted_by_its_own_in_the_file(tmp_path: Path) -> None:
    run, columns, urdf = robot_of(tmp_path)
    given = ("predict", run, "--columns", columns, "--model", urdf, "--target", "sensor_torque")
    done = call(*given, "--joint", "all", "--out", tmp_path / "p")
    assert done.exit_code == 0, done.stderr
    for name, missing in (("elbow", 0.4), ("shoulder", None)):
        (table,) = (tmp_path / "p" / f"joint_{name}").glob("*.csv")
        made = pandas.read_csv(table)
        fast = np.abs(pandas.read_csv(run)[f"w_{name}"]) > 0.1
        if missing is None:  # the file says nothing of this joint
            assert (made["predicted"] == 0.0).all()
        else:
            assert made["residual"][fast].abs().to_numpy() == pytest.approx(missing, abs=1e-6)


def test_a_joint_that_the_file_lacks_leaves_the_others(tmp_path: Path) -> None:
    run, columns, urdf = robot_of(tmp_path)
    urdf.write_text(urdf.read_text().replace('"shoulder"', '"hip"'))
    given = ("predict", run, "--columns", columns, "--model", urdf, "--target", "sensor_torque")
    done = call(*given, "--joint", "all", "--out", tmp_path / "p")
    assert done.exit_code == 2 and done.stderr.count("\n") == 1
    assert "has no joint 'shoulder'" in done.stderr and "elbow, hip" in done.stderr
    assert sorted(each.name for each in (tmp_path / "p").iterdir()) == [
        "joint_elbow",
        "joints.csv",
    ]


def test_discover_of_every_joint_starts_from_its_own_in_the_file(tmp_path: Path) -> None:
    run, columns, urdf = robot_of(tmp_path)
    out = tmp_path / "found"
    with undrawn():
        done = call("discover", run, "--columns", columns, "--model", urdf, "--joint", "all",
                    "--target", "sensor_torque", "--out", out)  # fmt: skip
    assert done.exit_code == 0, done.stderr
    base = {
        name: json.loads((out / f"joint_{name}" / "discovery.json").read_text())["base_effects"]
        for name in ("elbow", "shoulder")
    }
    assert base == {"elbow": ["viscous_friction", "coulomb_friction"], "shoulder": []}
