"""A model as MuJoCo engine plugins, from the core's own headers, in one library.

One is the passive force of one joint; another, where the model has a torsion, couples the motor's
hinge and the link's (`coupling`).

MuJoCo has the inertia and the weight of what moves, and its actuators' torque; what the joint takes
beside these is the plugin's. So of a part's effects

- those that carry load (inertia, gravity) are left to MuJoCo's bodies and armature,
- those of what is measured alone, such as a sensor's gain or drift, are left out,
- all others run, with the load that MuJoCo has in place of the model's own.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flexspline.about import __version__
from flexspline.effects import Effect
from flexspline.effects.causes import GRAVITY, LAG
from flexspline.errors import InputError, listed
from flexspline.exporting.coupling import (
    TORSION,
    Coupling,
    coupling_of,
    kept_effects,
    read_temperatures,
    usual_temperature,
    without_log,
)
from flexspline.exporting.cpp_text import comment, include, number, string_literal
from flexspline.exporting.header import by_motor_encoder, header_text, own_headers
from flexspline.exporting.plain_joint import (
    ARMATURE,
    attributes,
    mjcf_file,
    output_torque,
    plain_joint,
)
from flexspline.files import atomic_write
from flexspline.model import PART_OF, Model, Part
from flexspline.own import design_of
from flexspline.programs import call, firmware_folder, host_compiler, include_folder
from flexspline.signals import gear_of

__all__ = [
    "Plugin",
    "Plugins",
    "compile_plugin",
    "library_name",
    "plugin_files",
    "plugin_of",
    "plugins_of",
    "write_plugin",
]

# What all plugins share; no namespace and no own effect is called so.
INSTANCE, JOINT, COUPLING = (f"mujoco-{name}.hpp" for name in ("instance", "joint", "coupling"))
INSTALL = "run pip install 'flexspline[mujoco]'"
OPTIONS = ("-std=c++20", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
SUFFIXES = {"darwin": ".dylib", "win32": ".dll"}
USUAL_SPEED = 1.0  # rad/s, where a model has no range of it
SPEEDS = 101  # of a range, at which friction is looked at
UNKNOWN_INERTIA = 1.0  # kg m², in an MJCF to copy from
SHARE_OF_LONGEST = 0.1  # of an MJCF's timestep: a coupling's resonance is right to 0.2 % then


@dataclass(frozen=True)
class Plugin:
    """What of a model runs in MuJoCo.

    Parameters
    ----------
    model : with one part, whose effects act on the joint; it says the same torque as the plugin
        for a log with MuJoCo's channels, `reference_torque` the load.
    part : that part.
    torque : Nm at the output that the part's unit is worth; the plugin's force is −torque · y.
    ratio : of the gear.
    temperature : deg C, where an MJCF gives none: the middle of the fit's range, else 25.
    temperatures : deg C, between which the model is asked where the joint heats itself.
    load : Nm, the largest at standstill that the fit knows: its range, and the weight.
    left : effects that do not run, and what has their place.
    """

    model: Model
    part: Part
    torque: float
    ratio: float
    temperature: float
    temperatures: tuple[float, float]
    load: float
    left: Mapping[str, str]


@dataclass(frozen=True)
class Plugins:
    """What of a model runs in MuJoCo: the force on a joint, the coupling of two hinges, or both."""

    joint: Plugin | None
    coupling: Coupling | None

    @property
    def models(self) -> tuple[Model, ...]:
        """The models of what runs, of one part each."""
        return tuple(one.model for one in (self.joint, self.coupling) if one is not None)


def plugins_of(model: Model, target: str | None = None) -> Plugins:
    """Return what of a model runs in MuJoCo: of a target that part, else its torsion too.

    Raises
    ------
    InputError
        As `plugin_of` and `coupling_of`.
    """
    if target not in (None, TORSION) or PART_OF[TORSION] not in model.parts:
        return Plugins(plugin_of(model, target), None)
    others = {name: part for name, part in model.parts.items() if part.target != TORSION}
    joint = plugin_of(replace(model, parts=others)) if others and target is None else None
    try:
        return Plugins(joint, coupling_of(model))
    except InputError as error:
        if joint is None:
            raise
        raise InputError(f"{error}; or give the target {joint.part.target} alone") from None


def plugin_of(model: Model, target: str | None = None) -> Plugin:
    """Return what of a model a MuJoCo plugin runs.

    Raises
    ------
    InputError
        Where there is no such part, its target is no torque, none of its effects acts on the joint,
        one reads what MuJoCo does not have, or a sensor's friction would drive the joint at a
        speed of the fit's range, as it does where the sensor sees it from the other side.
    """
    whole = model.part(target)
    torque = output_torque(model, whole)
    _require_braking(model, whole)
    effects, left = kept_effects(
        whole, _left, "that a plugin could run", "fit friction, or export with --format mujoco"
    )
    reads = {channel for effect in effects for channel in effect.reads}
    _require_channels(model, whole, reads)
    gravity = whole.coefficients_of(GRAVITY)
    weight = float(np.hypot(*gravity)) if len(gravity) else 0.0
    ranges = whole.record.get("validity", {})
    part = without_log(
        whole.keeping(lambda e: e.name not in left),
        known_load=(whole.known_load or "reference_torque") if "load" in reads else None,
    )
    return Plugin(
        Model({PART_OF[part.target]: part}, model.facts),
        part,
        torque,
        float(gear_of(model.facts, motor_encoder=False)["effective_ratio"]),
        usual_temperature(ranges),
        read_temperatures(ranges),
        max(map(abs, ranges.get("known_load", (0.0,)))) + torque * weight,
        left,
    )


def _left(effect: Effect) -> str:
    """What has the place of an effect that does not run; nothing where it does."""
    if effect.info.traits.inertial:
        return "the armature"
    if effect.info.carries_load:
        return "the mass of the bodies"
    if "M" not in effect.info.targets or effect.name == LAG:
        return "nothing: it is of what is measured, and no torque on the joint"
    return ""


def _require_braking(model: Model, part: Part) -> None:
    """Refuse friction of a sensor that drives the joint at a speed of the fit's range."""
    if PART_OF[part.target] != "sensor" or part.simulated is not None:
        return
    wanted = [e.info.traits.dissipative and e.reads == ("output_velocity",) for e in part.effects]
    friction = [effect for effect, take in zip(part.effects, wanted, strict=True) if take]
    of_term = np.repeat(wanted, [len(effect.terms) for effect in part.effects])
    if not friction:
        return
    fastest = np.abs(part.record.get("validity", {}).get("output_velocity", USUAL_SPEED)).max()
    speeds = np.linspace(0.0, fastest, SPEEDS)[1:]
    channels = {"output_velocity": np.concatenate([speeds, -speeds])}
    design = design_of(friction, gear_of(model.facts, motor_encoder=False))
    made = design.rows(channels, 2 * len(speeds), part.coefficients[of_term])
    ahead, back = np.split(np.asarray(made) @ part.coefficients[of_term], 2)
    level = 0.5 * (ahead - back)
    if (level < 0.0).any():
        worst = int(np.argmin(level))
        raise InputError(
            f"the friction of {part.target} is {level[worst]:.3g} {part.unit} at "
            f"{speeds[worst]:.3g} rad/s, which would drive the joint instead of braking it; turn "
            f"its sign if the sensor sees friction from the other side (--repair flip_sign="
            f"{part.target}), or fit what its speeds need (stribeck_friction, say)"
        )


def _require_channels(model: Model, part: Part, reads: set[str]) -> None:
    """Refuse what reads a motor's side that nothing relates to the joint."""
    of_motor = "motor_torque" in reads or ("motor_position" in reads and by_motor_encoder(part))
    if of_motor and "gear_ratio" not in model.facts:
        raise InputError(
            f"the model's part for {part.target} reads the motor's side, which MuJoCo has by the "
            "gear ratio alone, and the model lacks it; fit it again with --gear-ratio"
        )


def write_plugin(model: Model, namespace: str, folder: Path, target: str | None) -> None:
    """Write headers, source and MJCF of plugins, NAMESPACE.hpp, .cpp and .xml, into a folder.

    Raises
    ------
    InputError
        As `plugins_of`; where the core cannot hold a number or an own effect has no header.
    """
    plugins = plugins_of(model, target)
    own = {header.name: header.text for one in plugins.models for header in own_headers(one, None)}
    made: dict[str, str | bytes] = {}
    shared = [INSTANCE]
    if plugins.joint is not None:
        made[f"{namespace}.hpp"] = header_text(plugins.joint.model, namespace, of=model)
        shared.append(JOINT)
    if plugins.coupling is not None:
        name = of_torsion(namespace)
        made[f"{name}.hpp"] = header_text(plugins.coupling.model, name, of=model)
        shared.append(COUPLING)
    made |= {name: (firmware_folder() / "mujoco" / name).read_bytes() for name in shared}
    made[f"{namespace}.xml"] = _mjcf(_Scene.of(model, plugins, namespace))
    made[f"{namespace}.cpp"] = "\n".join(_source(plugins, namespace))
    if own.keys() & made.keys():
        raise InputError(
            f"{folder}: a folder of this name gives the plugin the name of the header of one of "
            "the model's own effects; export to another one"
        )
    for name, text in (own | made).items():
        atomic_write(folder / name, text)


def compile_plugin(namespace: str, folder: Path) -> None:
    """Compile the plugin that `write_plugin` wrote into a folder, `library_name` beside it.

    Raises
    ------
    InputError
        Where MuJoCo or the compiler is missing, or the compiler refuses.
    """
    mujoco = _mujoco_folder()
    command: list[str | Path] = [host_compiler(), *OPTIONS, f"-I{include_folder()}"]
    command += ["-isystem", mujoco / "include", f"{namespace}.cpp", _mujoco_library(mujoco)]
    made = library_name(namespace)
    call([*command, "-o", made], folder, does="compiling the plugin")


def plugin_files(namespace: str) -> list[str]:
    """Return the names that files of a plugin may have, beside the headers of own effects."""
    sources = [f"{namespace}{suffix}" for suffix in (".hpp", ".cpp", ".xml")]
    headers = [f"{of_torsion(namespace)}.hpp", INSTANCE, JOINT, COUPLING]
    return [*sources, *headers, library_name(namespace)]


def library_name(namespace: str) -> str:
    """Return the name of a plugin's library on this system."""
    return f"lib{namespace}{SUFFIXES.get(sys.platform, '.so')}"


def _mujoco_folder() -> Path:
    """The folder of Python's mujoco, which brings headers and library."""
    there = importlib.util.find_spec("mujoco")
    if there is None or there.origin is None:
        raise InputError(f"a plugin is compiled with MuJoCo, which is not installed; {INSTALL}")
    return Path(there.origin).parent


def _mujoco_library(folder: Path) -> Path:
    found = sorted(path for path in folder.glob("*mujoco*") if _is_library(path.name))
    if not found or not (folder / "include" / "mujoco" / "mujoco.h").is_file():
        raise InputError(
            f"{folder}: has no library or no headers of MuJoCo, with which a plugin is compiled; "
            f"{INSTALL}"
        )
    return found[0]


def _is_library(name: str) -> bool:
    return name.startswith("libmujoco.") or name == "mujoco.lib"


def _source(plugins: Plugins, namespace: str) -> Iterator[str]:
    """The plugins' source: how it is built and used, and what of the model is constant in it."""
    joint, coupling = plugins.joint, plugins.coupling
    library = library_name(namespace)
    files = f'{namespace}.cpp "$M"/libmujoco.* -o {library}'
    headers = [name for name, one in ((JOINT, joint), (COUPLING, coupling)) if one is not None]
    targets = listed(one.part.target for one in (joint, coupling) if one is not None)
    yield f"// A MuJoCo plugin, made by flexspline {__version__} of a model of {targets}."
    yield f"// What it does with which numbers: {listed(headers)} beside it."
    yield "// Build it in this folder with"
    yield "//"
    yield '//   F=$(python3 -c "import flexspline; print(flexspline.get_include())")'
    yield '//   M=$(python3 -c "import mujoco; print(mujoco.__path__[0])")'
    yield f'//   c++ {" ".join(OPTIONS)} -I"$F" -I"$M/include" {files}'
    yield "//"
    yield "// and load it, in Python, before the MJCF that names it (an example is beside it):"
    yield "//"
    yield f'//   mujoco.mj_loadPluginLibrary("{library}")'
    for one in (joint, coupling):
        for name, why in one.left.items() if one is not None else ():
            yield f"//\n// Left out: {name}; {why}."
    if joint is not None:
        yield include(f"{namespace}.hpp")
    if coupling is not None:
        yield include(f"{of_torsion(namespace)}.hpp")
    yield from map(include, headers)
    yield ""
    yield "namespace {"
    yield ""
    if joint is not None:
        yield from _joint_settings(joint, namespace)
    if coupling is not None:
        yield from _coupling_settings(coupling, of_torsion(namespace))
    yield "// As the library is loaded; mjPLUGIN_LIB_INIT is another one in each version of MuJoCo."
    if joint is not None:
        yield "const int slot = flexspline::mujoco::JointPlugin<Settings>::enter();"
    if coupling is not None:
        yield "const int other = flexspline::mujoco::CouplingPlugin<Between>::enter();"
    yield ""
    yield "}  // namespace"
    yield ""


def _joint_settings(plugin: Plugin, namespace: str) -> Iterator[str]:
    constants = (
        (plugin.torque, "torque", "Nm at the output that a unit of the model is worth"),
        (plugin.ratio, "ratio", "of the gear"),
        *_temperatures(plugin),
        (plugin.load, "load", "Nm, the largest at standstill, as far as the fit knows"),
    )
    yield from _struct("Settings", namespace, _constants(constants))


def _coupling_settings(coupling: Coupling, namespace: str) -> Iterator[str]:
    fields = (
        (coupling.ratio, "ratio", "of the gear"),
        (coupling.largest_load, "largest_load", "Nm at the output"),
        (coupling.least_compliance, "least_compliance", "rad at the motor per Nm at the output"),
    )
    yield from _struct(
        "Between",
        namespace,
        (
            *_constants(_temperatures(coupling)),
            "  static constexpr flexspline::Coupling<double> coupling{",
            *(
                f"      .{name} = {number(value, name)},  // {comment(what)}"
                for value, name, what in fields
            ),
            "  };",
        ),
    )


def _temperatures(of: Plugin | Coupling) -> tuple[tuple[float, str, str], ...]:
    coldest, warmest = of.temperatures
    return (
        (of.temperature, "temperature", "deg C, where the MJCF gives none"),
        (coldest, "coldest", "deg C, of the fit"),
        (warmest, "warmest", "deg C, of the fit"),
    )


def _struct(kind: str, namespace: str, constants: Iterable[str]) -> Iterator[str]:
    """What a plugin knows at compile time: its name, its model, and lines of constants."""
    yield f"struct {kind} {{"
    yield f"  static constexpr const char* name = {string_literal(plugin_name(namespace))};"
    yield f"  static constexpr auto& model = {namespace}::model<double>;"
    yield from constants
    yield "};"
    yield ""


def _constants(constants: Iterable[tuple[float, str, str]]) -> Iterator[str]:
    for value, name, what in constants:
        yield f"  static constexpr double {name} = {number(value, name)};  // {comment(what)}"


def plugin_name(namespace: str) -> str:
    """Return the name by which MuJoCo knows a plugin."""
    return f"flexspline.{namespace}"


def of_torsion(namespace: str) -> str:
    """Return the namespace of a plugin's coupling."""
    return f"{namespace}_torsion"


@dataclass(frozen=True)
class _Scene:
    """What an MJCF to copy from has: hinges, inertias [kg m²] at the output, instances."""

    plugins: Plugins
    namespace: str
    link: str
    motor: str  # the hinge that friction acts on, which without a coupling is the link's
    armature: float
    known_armature: bool
    corrects: bool

    @classmethod
    def of(cls, model: Model, plugins: Plugins, namespace: str) -> _Scene:
        link, found, corrects = str(model.facts.get("joint") or "joint"), 0.0, False
        if plugins.joint is not None:
            joint = plain_joint(model, plugins.joint.part.target, ((ARMATURE, 0),))
            found, corrects = joint.armature, joint.corrects
        if plugins.coupling is None:
            return cls(plugins, namespace, link, link, found, found > 0.0, corrects)
        armature = found if found > 0.0 else UNKNOWN_INERTIA
        return cls(plugins, namespace, link, f"{link}_motor", armature, found > 0.0, corrects)

    def instances(self) -> Iterator[tuple[str, str, list[tuple[str, str]]]]:
        """Plugin, name of its instance, configs."""
        joint, coupling = self.plugins.joint, self.plugins.coupling
        if joint is not None:
            config = [("joint", self.motor)]
            if any("temperature" in effect.reads for effect in joint.part.effects):
                config.append(("temperature", repr(joint.temperature)))
            if self.known_armature:
                config.append(("implicit", "true"))
            yield plugin_name(self.namespace), self.motor, config
        if coupling is not None:
            config = [("joint", self.link), ("motor", self.motor)]
            if any("temperature" in effect.reads for effect in coupling.part.effects):
                config.append(("temperature", repr(coupling.temperature)))
            yield plugin_name(of_torsion(self.namespace)), of_torsion(self.link), config

    def timestep(self) -> float | None:
        """A tenth of the longest one, of two digits; None without a coupling."""
        if self.plugins.coupling is None:
            return None
        longest = self.plugins.coupling.longest_step(self.armature, UNKNOWN_INERTIA)
        return float(f"{SHARE_OF_LONGEST * longest:.1e}")


def _mjcf(scene: _Scene) -> str:
    """A file with one hinge joint, or two where the gear twists, and the plugins on them."""
    step = scene.timestep()
    bodies = [_body(scene.motor, 1e-9, scene.armature)]
    if step is not None:
        bodies.append(_body(scene.link, UNKNOWN_INERTIA, 0.0))
    inside = [
        *([] if step is None else [f"  <option {attributes([('timestep', repr(step))])}/>"]),
        "  <extension>",
        *(line for one in scene.instances() for line in _instance(*one)),
        "  </extension>",
        "  <worldbody>",
        *(line for body in bodies for line in body),
        "  </worldbody>",
    ]
    return mjcf_file(scene.link, _said(scene), inside)


def _instance(plugin: str, name: str, config: list[tuple[str, str]]) -> Iterator[str]:
    yield f"    <plugin {attributes([('plugin', plugin)])}>"
    yield f"      <instance {attributes([('name', name)])}>"
    for key, value in config:
        yield f"        <config {attributes([('key', key), ('value', value)])}/>"
    yield "      </instance>"
    yield "    </plugin>"


def _body(name: str, inertia: float, armature: float) -> list[str]:
    about = " ".join([repr(inertia)] * 3)
    mass = "0.001" if inertia < 1e-3 else "1"
    inertial = attributes([("pos", "0 0 0"), ("mass", mass), ("diaginertia", about)])
    hinge = [("type", "hinge"), ("axis", "0 0 1"), ("armature", repr(armature))]
    return [
        "    <body>",
        f"      <inertial {inertial}/>",
        f"      <joint {attributes([('name', name)])} {attributes(hinge)}/>",
        "    </body>",
    ]


def _said(scene: _Scene) -> Iterator[str]:
    joint, coupling = scene.plugins.joint, scene.plugins.coupling
    source = f"{scene.namespace}.cpp"
    if joint is not None:
        yield f"Made by flexspline {__version__} of the model of {joint.part.target}: a joint whose"
        yield f"passive force is the plugin of {source}, which says how it is built and loaded."
        yield "Each joint with it has an instance of its own, which names it."
        yield ""
        yield from _lists(joint)
        yield ""
        yield from _said_of_joint(scene, joint)
    if joint is not None and coupling is not None:
        yield ""
    if coupling is not None:
        if joint is None:
            yield f"Made by flexspline {__version__} of the model of torsion, by the plugin of"
            yield f"{source}, which says how it is built and loaded."
            yield ""
        yield from _said_of_coupling(scene, coupling)


def _lists(one: Plugin | Coupling) -> Iterator[str]:
    """What runs and what does not."""
    yield "The plugin runs:"
    for effect in one.part.effects:
        yield f"  {effect.name}"
    if one.left:
        yield ""
        yield "Left out, with what has its place:"
        width = max(map(len, one.left))
        yield from (f"  {name:<{width}}  {why}" for name, why in one.left.items())


def _said_of_joint(scene: _Scene, joint: Plugin) -> Iterator[str]:
    yield "The armature is all inertia that the model found: where your link has its own, take that"
    if scene.corrects:
        yield "off. The model corrects a simulation: keep damping and frictionloss of its joint."
    else:
        yield "off. Leave damping and frictionloss at zero, for the plugin has them."
    yield ""
    yield "The config implicit lets friction hold at any timestep. Without it, as for Runge-Kutta,"
    yield "the force is that of the velocity at the start of a step, and MuJoCo warns of steps that"
    yield "are too long for it."
    if any("temperature" in effect.reads for effect in joint.part.effects):
        yield ""
        yield "The joint's own losses heat it where an instance has the configs thermal_resistance"
        yield "[K/W] and thermal_time_constant [s], and ambient [deg C] if that is not temperature."


def _said_of_coupling(scene: _Scene, coupling: Coupling) -> Iterator[str]:
    yield "The gear twists: the link has a hinge, and the motor's side another one on a body beside"
    yield "it, with the same axis. The motor's turns as the output would if nothing twisted, so its"
    yield "armature, its actuator and its friction are those at the output, and its body weighs"
    yield "next to nothing. Inertias of 1 kg m^2 stand for those of your joint."
    yield ""
    yield from _lists(coupling)
    yield ""
    yield f"It is up to {coupling.stiffness:.3g} Nm/rad stiff at the output (K), and straight"
    yield f"beyond {coupling.largest_load:.3g} Nm."
    if coupling.largest_load < coupling.fitted_load:
        yield f"The fit goes up to {coupling.fitted_load:.3g} Nm, where its loop, as it sticks,"
        yield "leaves too little of what the rest yields."
    yield "Its force is that of the start of a step, with each of MuJoCo's integrators, and a step"
    yield "is refused that is not below"
    yield ""
    yield "  2 / sqrt(K (1/J_motor + 1/J_link))"
    yield ""
    yield "The timestep here is a tenth of that, at which the resonance is right to 0.2 %. Nothing"
    yield "damps it but the loop: to damp it, give a fixed tendon over both hinges, coef 1 and -1,"
    yield "with damping."
