"""A model as a MuJoCo engine plugin: the passive force of one joint, from the core's own headers.

MuJoCo has the inertia and the weight of what moves, and its actuators' torque; what the joint takes
beside these is the plugin's. So of a part's effects

- those that carry load (inertia, gravity) are left to MuJoCo's bodies and armature,
- those of what is measured alone, such as a sensor's gain or drift, are left out,
- all others run, with the load that MuJoCo has in place of the model's own.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flexspline.about import __version__
from flexspline.effects import Effect
from flexspline.effects.causes import GRAVITY, LAG
from flexspline.errors import InputError, listed
from flexspline.exporting.cpp_text import comment, include, number, string_literal
from flexspline.exporting.header import by_motor_encoder, header_text, own_headers
from flexspline.exporting.plain_joint import (
    ARMATURE,
    PlainJoint,
    attributes,
    output_torque,
    plain_joint,
)
from flexspline.exporting.plain_joint import comment as xml_comment
from flexspline.files import atomic_write
from flexspline.model import PART_OF, Model, Part
from flexspline.own import design_of
from flexspline.programs import call, firmware_folder, host_compiler, include_folder
from flexspline.signals import gear_of

__all__ = [
    "Plugin",
    "compile_plugin",
    "library_name",
    "plugin_files",
    "plugin_of",
    "write_plugin",
]

COMMON = "mujoco-joint.hpp"  # what all plugins share; no namespace and no own effect is called so
INSTALL = "run pip install 'flexspline[mujoco]'"
OPTIONS = ("-std=c++20", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
SUFFIXES = {"darwin": ".dylib", "win32": ".dll"}
USUAL_TEMPERATURE = 25.0  # deg C, as in the core's sample
USUAL_SPEED = 1.0  # rad/s, where a model has no range of it
SPEEDS = 101  # of a range, at which friction is looked at


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
    load : Nm, the largest at standstill that the fit knows: its range, and the weight.
    left : effects that do not run, and what has their place.
    """

    model: Model
    part: Part
    torque: float
    ratio: float
    temperature: float
    load: float
    left: Mapping[str, str]


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
    left = {effect.name: why for effect in whole.effects if (why := _left(effect))}
    effects = tuple(effect for effect in whole.effects if effect.name not in left)
    if not any(effect.terms for effect in effects):
        raise InputError(
            f"the model's part for {whole.target} has no effect that a plugin could run: "
            f"{listed(left) or 'it is empty'}; fit friction, or export with --format mujoco"
        )
    reads = {channel for effect in effects for channel in effect.reads}
    _require_channels(model, whole, reads)
    first, kept, weight = 0, [], 0.0
    for effect in whole.effects:
        last = first + len(effect.terms)
        if effect.name not in left:
            kept.append(whole.coefficients[first:last])
        if effect.name == GRAVITY:
            weight = float(np.hypot(*whole.coefficients[first:last]))
        first = last
    ranges = whole.record.get("validity", {})
    here = ("channels", "prepared")  # of the log: an encoder, a filter
    part = replace(
        whole,
        effects=effects,
        coefficients=np.concatenate(kept),
        known_load=(whole.known_load or "reference_torque") if "load" in reads else None,
        record={key: value for key, value in whole.record.items() if key not in here},
    )
    low, high = ranges.get("temperature", (USUAL_TEMPERATURE,) * 2)
    return Plugin(
        Model({PART_OF[part.target]: part}, model.facts),
        part,
        torque,
        float(gear_of(model.facts, motor_encoder=False)["effective_ratio"]),
        0.5 * (float(low) + float(high)),
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


def write_plugin(model: Model, namespace: str, folder: Path, target: str | None) -> Plugin:
    """Write header, source and MJCF of a plugin, NAMESPACE.hpp, .cpp and .xml, into a folder.

    Raises
    ------
    InputError
        As `plugin_of`; where the core cannot hold a number or an own effect has no header.
    """
    plugin = plugin_of(model, target)
    own = own_headers(plugin.model, None)
    texts: dict[str, str | bytes] = {header.name: header.text for header in own}
    texts[f"{namespace}.hpp"] = header_text(plugin.model, namespace, of=model)
    texts[COMMON] = (firmware_folder() / "mujoco" / COMMON).read_bytes()
    joint = plain_joint(model, target, ((ARMATURE, 0),))
    texts[f"{namespace}.xml"] = _mjcf(joint, plugin, namespace)
    texts[f"{namespace}.cpp"] = "\n".join(_source(plugin, namespace))
    if len(texts) < len(own) + 4:
        raise InputError(
            f"{folder}: a folder of this name gives the plugin the name of the header of one of "
            "the model's own effects; export to another one"
        )
    for name, text in texts.items():
        atomic_write(folder / name, text)
    return plugin


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
    """Return the names of the files of a plugin, beside the headers of own effects."""
    sources = [f"{namespace}{suffix}" for suffix in (".hpp", ".cpp", ".xml")]
    return [*sources, COMMON, library_name(namespace)]


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


def _source(plugin: Plugin, namespace: str) -> Iterator[str]:
    """The plugin's source: how it is built and used, and what of the model is constant in it."""
    target = plugin.part.target
    constants = (
        (plugin.torque, "torque", "Nm at the output that a unit of the model is worth"),
        (plugin.ratio, "ratio", "of the gear"),
        (plugin.temperature, "temperature", "deg C, where the MJCF gives none"),
        (plugin.load, "load", "Nm, the largest at standstill, as far as the fit knows"),
    )
    library = library_name(namespace)
    files = f'{namespace}.cpp "$M"/libmujoco.* -o {library}'
    yield f"// A MuJoCo plugin, made by flexspline {__version__} of a model of {target}."
    yield f"// What it does with which numbers: {COMMON} beside it. Build it in this folder with"
    yield "//"
    yield '//   F=$(python3 -c "import flexspline; print(flexspline.get_include())")'
    yield '//   M=$(python3 -c "import mujoco; print(mujoco.__path__[0])")'
    yield f'//   c++ {" ".join(OPTIONS)} -I"$F" -I"$M/include" {files}'
    yield "//"
    yield "// and load it, in Python, before the MJCF that names it (an example is beside it):"
    yield "//"
    yield f'//   mujoco.mj_loadPluginLibrary("{library}")'
    for name, why in plugin.left.items():
        yield f"//\n// Left out: {name}; {why}."
    yield include(f"{namespace}.hpp")
    yield include(COMMON)
    yield ""
    yield "namespace {"
    yield ""
    yield "struct Settings {"
    yield f"  static constexpr const char* name = {string_literal(plugin_name(namespace))};"
    yield f"  static constexpr auto& model = {namespace}::model<double>;"
    for value, name, what in constants:
        yield f"  static constexpr double {name} = {number(value, name)};  // {comment(what)}"
    yield "};"
    yield ""
    yield "// As the library is loaded; mjPLUGIN_LIB_INIT is another one in each version of MuJoCo."
    yield "const int slot = flexspline::mujoco::JointPlugin<Settings>::enter();"
    yield ""
    yield "}  // namespace"
    yield ""


def plugin_name(namespace: str) -> str:
    """Return the name by which MuJoCo knows a plugin."""
    return f"flexspline.{namespace}"


def _mjcf(joint: PlainJoint, plugin: Plugin, namespace: str) -> str:
    """A file with one hinge joint and the plugin on it."""
    named = attributes([("name", joint.name)])
    hinge = attributes([("type", "hinge"), ("axis", "0 0 1"), ("armature", repr(joint.armature))])
    config = [("joint", joint.name)]
    if any("temperature" in effect.reads for effect in plugin.part.effects):
        config.append(("temperature", repr(plugin.temperature)))
    if joint.armature > 0.0:
        config.append(("implicit", "true"))
    inertial = attributes(
        [("pos", "0 0 0"), ("mass", "0.001"), ("diaginertia", "1e-09 1e-09 1e-09")]
    )
    return "\n".join(
        [
            f"<mujoco {attributes([('model', joint.name)])}>",
            xml_comment(_said(joint, plugin, namespace), "  "),
            '  <compiler angle="radian"/>',
            "  <extension>",
            f"    <plugin {attributes([('plugin', plugin_name(namespace))])}>",
            f"      <instance {named}>",
            *(f"        <config {attributes([('key', k), ('value', v)])}/>" for k, v in config),
            "      </instance>",
            "    </plugin>",
            "  </extension>",
            "  <worldbody>",
            "    <body>",
            f"      <inertial {inertial}/>",
            f"      <joint {named} {hinge}/>",
            "    </body>",
            "  </worldbody>",
            "</mujoco>",
            "",
        ]
    )


def _said(joint: PlainJoint, plugin: Plugin, namespace: str) -> Iterator[str]:
    yield f"Made by flexspline {__version__} of the model of {plugin.part.target}: a joint whose"
    yield f"passive force is the plugin of {namespace}.cpp, which says how it is built and loaded."
    yield "Each joint with it has an instance of its own, which names it."
    yield ""
    yield "The plugin runs:"
    for effect in plugin.part.effects:
        yield f"  {effect.name}"
    if plugin.left:
        yield ""
        yield "Left out, with what has its place:"
        width = max(map(len, plugin.left))
        yield from (f"  {name:<{width}}  {why}" for name, why in plugin.left.items())
    yield ""
    yield "The armature is all inertia that the model found: where your link has its own, take that"
    if joint.corrects:
        yield "off. The model corrects a simulation: keep damping and frictionloss of its joint."
    else:
        yield "off. Leave damping and frictionloss at zero, for the plugin has them."
    yield ""
    yield "The config implicit lets friction hold at any timestep. Without it, as for Runge-Kutta,"
    yield "the force is that of the velocity at the start of a step, and MuJoCo warns of steps that"
    yield "are too long for it."
