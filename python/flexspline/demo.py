"""`flexspline demo`: from runs that hide an effect to a model on the controller.

The runs come through a laboratory's recorder (`rigs/sensor.py`), and `discover` finds the hidden
effect. The last step compiles the exported header and runs it sample by sample, beside the
prediction of `predict`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import textwrap
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flexspline.about import get_include
from flexspline.discovery.discovering import discover
from flexspline.discovery.result import Discovery
from flexspline.effects import Effect, effect
from flexspline.exporting import export, namespace_of
from flexspline.exporting.cpp_text import include
from flexspline.files import whole_folder
from flexspline.fitting import fit
from flexspline.least_squares.result import Fit
from flexspline.logs.checks import check
from flexspline.logs.log import Log, Source
from flexspline.logs.read import read_log
from flexspline.logs.writing import write_log
from flexspline.model import Model
from flexspline.plot.canvas import own_style
from flexspline.prepared import prepared
from flexspline.rigs import zhang_rig
from flexspline.rigs.sensor import SPEEDS, Recorder, Rig, Truth, sensor_rig
from flexspline.signals import channels_for, core_channels

__all__ = ["BASE", "demo", "run_exported"]

Say = Callable[[str], object]

BASE = (
    effect("offset"),
    effect("coulomb_friction"),
    effect("viscous_friction"),
    effect("inertia"),
    effect("output_ripple", orders=[1, 2]),
    effect("wave_generator_ripple", orders=[2]),
    effect("temperature_drift"),
)
TARGET = "sensor_torque"
TRAINING, HELD_OUT = 4, 2  # runs
SECONDS, RATE = 24.0, 200.0
RECORDING = "recording.txt"
SAME_SPEED = 0.1  # share by which a row's speed may differ from the one commanded

COMPILERS = ("c++", "g++", "clang++")
FLAGS = ("-std=c++20", "-O2", "-ffp-contract=off")
DEVICE_TIMEOUT = 120.0
SMOOTHED = "\n   Both read inputs smoothed without delay; the header smooths nothing by itself."
ANGLES = ("output_position", "motor_position")

PROGRAM = """\
#include <cstdio>
{include}

int main() {{
  flexspline::Sample<double> at;
  [[maybe_unused]] {namespace}::Model<double>::State state;
  double in[{count}], torque = 0;
  for (;;) {{
    for (double& value : in) {{
      if (std::scanf("%lf", &value) != 1) return 0;
    }}
{assignments}
    if ({namespace}::model<double>.predict({given}) != flexspline::Status::ok) return 1;
    std::printf("%.17g\\n", torque);
  }}
}}
"""


@dataclass(frozen=True)
class Demo:
    """What the demo found: names in order, and the RMSE [Nm] on held-out runs before and after."""

    found: tuple[str, ...]
    before: float
    after: float
    fit: Fit


def demo(
    out: str | os.PathLike[str] = "flexspline-demo", *, seed: int = 1, say: Say = print
) -> Demo:
    """Simulate, read, check, fit, find what is missing, export, run the exported model.

    Parameters
    ----------
    out : folder that receives runs, model, report, figure and header, whole or not at all.
    seed : of the simulated rig.
    say : gets the lines of the story, one after the other.

    Raises
    ------
    InputError
        Where `out` cannot be written.
    """
    with whole_folder(out, last="model.json") as draft:
        rig = sensor_rig(
            TRAINING + HELD_OUT, duration=SECONDS, rate=RATE, seed=seed, recorder=Recorder()
        )
        logs = _recorded(rig, draft, Path(out), say)
        training, unseen = logs[:TRAINING], logs[TRAINING:]
        say(f"\n3. Fit today's model to runs 1 to {TRAINING}:\n{_names(BASE)}.")
        base = fit(BASE, training, TARGET)
        before = unseen_rmse(base, unseen)
        say(f"   RMSE {base.rmse:.4f} Nm on these, {before:.4f} Nm on runs {_held_out()}, unseen.")
        _say_where(base, say)
        say("\n4. Ask discover what it lacks, on the same runs:\n")
        found = discover(base.model, training)
        say(str(found))
        final = found.fit
        after = unseen_rmse(final, unseen)
        _say_result(final, rig.truth, before, after, say)
        _leave(found, draft)
        _leave_recordings(logs[-1], draft, seed)
        say(f"\n6. {run_exported(draft / 'joint.hpp', final.model, unseen[0])}")
    _say_files(Path(out), say)
    return Demo(found.names, before, after, final)


def unseen_rmse(made: Fit, logs: Iterable[Log]) -> float:
    """RMSE of a fit's model on logs that it was not fitted to, Nm."""
    residual = np.concatenate([made.predict(log).residual for log in logs])
    return float(np.sqrt(np.mean(residual**2)))


def _recorded(rig: Rig, draft: Path, out: Path, say: Say) -> list[Log]:
    truth = rig.truth
    say(
        f"1. Simulate a joint with a strain wave gear (N = 100) and a torque sensor, no load:\n"
        f"   {len(rig.logs)} runs of {rig.logs[0].duration:.0f} s at {RATE:g} Hz, both directions, "
        f"{min(SPEEDS):g} to {max(SPEEDS):g} rad/s.\n"
        f"   Put in:\n{_names(truth.model.part(TARGET).effects)},\n"
        f"   and what hides among them: presliding ({truth.presliding_level:g} Nm), "
        f"coloured noise ({truth.noise:g} Nm).\n{_recorder_line(Recorder())}"
    )
    logs = []
    for log in rig.logs:
        write_log(log, draft / f"{log.name}.csv")
        logs.append(_named_after(read_log(draft / f"{log.name}.csv"), draft, out))
    findings = [finding for log in logs for finding in check(log, target=TARGET)]
    say(
        f"\n2. Write the runs as CSV, read them back and check them: "
        f"{sum(len(log) for log in logs)} rows, {len(findings) or 'no'} findings."
    )
    for finding in findings:
        say(f"   {finding.severity}: {finding.sentence}")
    return logs


def _recorder_line(recorder: Recorder) -> str:
    return (
        f"   The recorder adds: encoders of {recorder.output_bits} and {recorder.motor_bits} bit, "
        f"velocity through {recorder.velocity_bandwidth:g} Hz\n"
        f"   with {recorder.velocity_noise:g} rad/s of noise, torque {recorder.torque_noise:g} Nm, "
        f"temperature {recorder.temperature_noise:g} K, jitter {recorder.jitter * 1e6:g} µs."
    )


def _named_after(log: Log, draft: Path, out: Path) -> Log:
    """Return the log as if it had been read from where it will lie."""
    history = [sentence.replace(str(draft), str(out)) for sentence in log.history]
    assert log.source is not None
    path = log.source.path.replace(str(draft), str(out))
    return replace(log, history=history, source=Source(path, log.source.sha256, log.source.rows))


def _say_where(base: Fit, say: Say) -> None:
    """Show the residual along the motion at each speed of the rig: left-over friction."""
    velocity = np.concatenate([run.log["output_velocity"] for run in base.runs])
    opposing = np.concatenate([run.residual for run in base.runs]) * np.sign(velocity)
    say("   Where it disagrees: mean residual in the direction of motion, by speed:")
    for speed in SPEEDS:
        mean = float(opposing[np.abs(np.abs(velocity) / speed - 1.0) < SAME_SPEED].mean())
        say(f"   {speed:>6g} rad/s  {mean:+.4f} Nm  {('+' if mean > 0 else '-') * _bar(mean)}")
    say(f"   A sound model leaves zero at every speed; overall its RMSE is {base.rmse:.4f} Nm.")


def _bar(torque: float) -> int:
    return round(abs(torque) / 0.002)


def _say_result(final: Fit, truth: Truth, before: float, after: float, say: Say) -> None:
    say(
        f"\n5. Runs {_held_out()}, unseen: RMSE {before:.4f} Nm before, {after:.4f} Nm after "
        f"({after / before - 1:+.0%}); the noise alone: {truth.noise:.4f} Nm."
    )
    say(f"   {'parameter':<43} {'fit':>8}   error {'true':>9}  unit")
    for parameter in final.parameters:
        true = truth.value(parameter.name)
        value = round(parameter.value, 4) + 0.0  # no minus zero
        say(
            f"   {parameter.name:<43} {value:>8.4f} ±{parameter.standard_error:<7.4f}"
            f"{true:>9.4f}  {parameter.unit}"
        )
    say(
        f"   coulomb_friction holds the presliding element's {truth.presliding_level:g} Nm too: "
        "once it slips, the two are one."
    )


def _leave(found: Discovery, draft: Path) -> None:
    with own_style():
        found.plot().savefig(draft / "before_after.png", dpi=110)
    found.report(draft / "report.html")
    found.model.save(draft / "model.json")
    export(found.model, draft / "joint.hpp", format="header")


def _leave_recordings(log: Log, draft: Path, seed: int) -> None:
    """Leave a run as a laboratory's recorder would write it, and calibration runs of a sensor."""
    columns = {
        "t [ms]": log["time"] * 1e3,
        "Output angle [°]": np.degrees(log["output_position"]),
        "Output speed [1/min]": log["output_velocity"] * 30.0 / np.pi,
        "Motor angle [°]": np.degrees(log["motor_position"]),
        "Joint torque [mNm]": log[TARGET] * 1e3,
        "Temperature [°C]": log["temperature"],
    }
    names = ";".join(columns)
    np.savetxt(
        draft / RECORDING,
        np.column_stack(list(columns.values())),
        fmt="%.4f",
        delimiter=";",
        header=f"Bench 2;strain wave gear 100:1\nRun;{log.name}\n\n{names}",
        comments="",
        encoding="latin-1",
    )
    bench = zhang_rig(seed).bench
    for name, run in (
        ("load", bench.calibration(unloading=True)),
        ("oven", bench.oven()),
        ("warmup", bench.warm_up()),
    ):
        write_log(run, draft / f"{name}.csv")


def _say_files(out: Path, say: Say) -> None:
    runs = f"{out / 'run1.csv'} ... run{TRAINING + HELD_OUT}.csv"
    say(f"\nLeft in {out}: model.json, report.html (open it in a browser), before_after.png,")
    say(f"joint.hpp, and the runs {runs}; besides {RECORDING}, a run")
    say("as a recorder writes it, and load.csv, oven.csv, warmup.csv to calibrate a sensor with.")
    say("Next, the same by hand, and then with runs of your own:")
    say(f"  flexspline init {out / RECORDING} --out map.toml")
    say(f"  flexspline predict --model {out / 'model.json'} {out / 'run5.csv'} --out residual.csv")
    say("  flexspline fit --help")


def _held_out() -> str:
    return f"{TRAINING + 1} and {TRAINING + HELD_OUT}"


def _names(effects: Iterable[Effect]) -> str:
    """Names with commas, broken to lines that fit under the story's indent."""
    names = ", ".join(effect.name for effect in effects)
    return textwrap.fill(names, 84, initial_indent="   ", subsequent_indent="   ")


def run_exported(header: Path, model: Model, log: Log) -> str:
    """Compile a header with a small program, stream a log through it, and say what came out.

    Parameters
    ----------
    header : what `export` wrote of a model with one part.
    model : that model.
    log : a run with the channels that the model reads.

    Returns
    -------
    str
        One sentence: the largest difference from `Model.predict` in the unit of the target, or
        why it was not tried.
    """
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        return f"Not compiled: no C++ compiler here ({', '.join(COMPILERS)})."
    part = model.part()
    inputs = prepared(log, part.preparations)
    ready = channels_for(inputs, part.effects, part.known_load)
    channels = core_channels(ready, part.effects, part.known_load)
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "main.cpp"
        remembers = any(effect.info.remembers for effect in part.effects)
        source.write_text(_program(header, list(channels), remembers))
        device = Path(folder) / "device"
        include = ["-I", get_include(), "-I", str(header.parent.resolve())]
        built = _run([compiler, *FLAGS, *include, str(source), "-o", str(device)])
        if built.returncode:
            said = built.stderr.splitlines()
            why = next((line for line in said if "error" in line), (said or ["no message"])[0])
            return f"Not compiled: {Path(compiler).name} does not take it as C++20 ({why})."
        rows = np.column_stack(list(channels.values()))
        ran = _run([str(device)], "\n".join(map(repr, rows.ravel().tolist())))
    torque = np.array(ran.stdout.split(), dtype=np.float64)
    expected = model.predict(log).predicted
    if torque.shape != expected.shape:
        return f"The compiled program stopped after {len(torque)} of {len(expected)} samples."
    largest = float(np.abs(torque - expected).max())
    return (
        f"Compiled joint.hpp with {Path(compiler).name} and ran {len(torque)} samples of "
        f"{log.name} through it:\n   the largest difference from predict is "
        f"{largest:.2g} {part.unit}.{SMOOTHED if part.preparations else ''}"
    )


def _program(header: Path, channels: list[str], remembers: bool) -> str:
    lines = [
        f"    if (flexspline::read_radians(in[{k}], at.{name}) != flexspline::Status::ok) return 1;"
        if name in ANGLES
        else f"    at.{name} = in[{k}];"
        for k, name in enumerate(channels)
    ]
    return PROGRAM.format(
        include=include(header.name),
        count=len(channels),
        assignments="\n".join(lines),
        namespace=namespace_of(header),
        given="at, state, torque" if remembers else "at, torque",
    )


def _run(command: list[str], given: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, input=given, capture_output=True, text=True, timeout=DEVICE_TIMEOUT, check=False
    )
