"""`flexspline demo`: from runs that hide an effect to a model on the controller, told in lines.

The search for the hidden effect is a plain loop: each effect of the catalogue that is not in the
model is added by itself, and what counts is the error on runs that the fit never saw.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flexspline.demo_device import run_exported
from flexspline.effects import CATALOGUE, Effect, effect
from flexspline.export import export
from flexspline.files import whole_folder
from flexspline.fit.fitting import fit
from flexspline.fit.result import Fit
from flexspline.logs.checks import check
from flexspline.logs.convert import write_log
from flexspline.logs.log import Log, Source
from flexspline.logs.read import read_log
from flexspline.plot.canvas import PlainFigure, titled
from flexspline.plot.residuals import residual_over
from flexspline.rigs.sensor import SPEEDS, Rig, Truth, sensor_rig

__all__ = ["BASE", "Demo", "demo", "most_helpful"]

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
LEAST_GAIN = 0.05  # of the error on unseen runs; less is no discovery
SAME_SPEED = 0.1  # share by which a row's speed may differ from the one commanded
NEEDS_A_LOAD = (
    "gain_error",
    "gain_temperature_dependence",
    "sensor_nonlinearity",
    "torque_hysteresis",
    "sensor_lag",
)


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
    out : folder that receives runs, model, report, figures and header, whole or not at all.
    seed : of the simulated rig.
    say : gets the lines of the story, one after the other.

    Raises
    ------
    InputError
        Where `out` cannot be written.
    """
    with whole_folder(out, last="model.json") as draft:
        rig = sensor_rig(TRAINING + HELD_OUT, duration=SECONDS, rate=RATE, seed=seed)
        logs = _recorded(rig, draft, Path(out), say)
        training, unseen = logs[:TRAINING], logs[TRAINING:]
        say(f"\n3. Fit today's model to runs 1 to {TRAINING}:\n{_names(BASE)}.")
        base = fit(BASE, training, TARGET)
        before = unseen_rmse(base, unseen)
        say(f"   RMSE {base.rmse:.4f} Nm on these, {before:.4f} Nm on runs {_held_out()}, unseen.")
        _say_where(base, say)
        final, found = _extended(base, training, say)
        after = unseen_rmse(final, unseen)
        _say_result(final, rig.truth, before, after, say)
        _leave(base, final, draft)
        say(f"\n7. {run_exported(draft / 'joint.hpp', final.model, unseen[0])}")
    _say_files(Path(out), say)
    return Demo(found, before, after, final)


def most_helpful(now: Fit, logs: Sequence[Log], say: Say) -> tuple[str, Fit] | None:
    """Return the effect that lowers the error on unseen runs most, and its fit.

    None where the best lowers it by less than `LEAST_GAIN`.
    """
    trials = {}
    for name in _candidates(now.part.effects, logs):
        trial = fit([*now.part.effects, effect(name)], logs, TARGET, checks=False)
        trials[name] = trial
        gain = 1.0 - trial.cv_rmse / now.cv_rmse
        say(f"   + {name:<28} {now.cv_rmse:.4f} -> {trial.cv_rmse:.4f} Nm  ({-gain:+.1%})")
    ranked = sorted(trials, key=lambda name: trials[name].cv_rmse)
    if not ranked or trials[ranked[0]].cv_rmse > (1.0 - LEAST_GAIN) * now.cv_rmse:
        return None
    best = ranked[0]
    say(f"   => {best} was missing: {CATALOGUE[best].signature}.")
    if len(ranked) > 1:
        behind = trials[ranked[1]].cv_rmse / trials[best].cv_rmse - 1.0
        say(f"      {ranked[1]} comes next, {behind:.0%} behind on unseen runs.")
    return best, trials[best]


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
        f"encoder steps, coloured noise ({truth.noise:g} Nm)."
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


def _extended(base: Fit, logs: Sequence[Log], say: Say) -> tuple[Fit, tuple[str, ...]]:
    """Add effects, one after the other, until none helps clearly."""
    found: tuple[str, ...] = ()
    now = base
    say("\n4. Add each missing effect by itself; RMSE on the run left out of its fit:")
    while (step := most_helpful(now, logs, say)) is not None:
        name, now = step
        found = (*found, name)
        say(f"\n5. With {name} in the model, does anything else help?")
    say(f"   No effect gains {LEAST_GAIN:.0%} or more: stop.")
    return now, found


def _candidates(effects: Sequence[Effect], logs: Sequence[Log]) -> list[str]:
    """Effects that act on the sensor, can be read from these logs, and are not in the model."""
    known = {effect.name for effect in effects} | set(NEEDS_A_LOAD)
    channels = {*logs[0].channels, "output_acceleration", "load"}
    return [
        info.name
        for info in CATALOGUE.values()
        if "S" in info.targets
        and info.name not in known
        and not any(info.name.startswith(name) for name in known)  # another form of one in it
        and not info.pairs  # orders belong to an owner, and this joint has no poles to own them
        and channels.issuperset(info.reads)
    ]


def _say_result(final: Fit, truth: Truth, before: float, after: float, say: Say) -> None:
    say(
        f"\n6. Runs {_held_out()}, unseen: RMSE {before:.4f} Nm before, {after:.4f} Nm after "
        f"({after / before - 1:+.0%}); the noise alone: {truth.noise:.4f} Nm."
    )
    say(f"   {'parameter':<43} {'fit':>8}   error {'true':>9}  unit")
    for parameter in final.parameters:
        true = truth.value(parameter.name)
        say(
            f"   {parameter.name:<43} {parameter.value:>8.4f} ±{parameter.standard_error:<7.4f}"
            f"{true:>9.4f}  {parameter.unit}"
        )
    say(
        f"   coulomb_friction holds the presliding element's {truth.presliding_level:g} Nm too: "
        "once it slips, the two are one."
    )


def _leave(base: Fit, final: Fit, draft: Path) -> None:
    _figure(base, final).savefig(draft / "before_after.png", dpi=110)
    final.report(draft / "report.html")
    final.model.save(draft / "model.json")
    export(final.model, draft / "joint.hpp", format="header")


def _figure(base: Fit, final: Fit) -> Figure:
    """Residual over velocity and over time, without the effects found and with them."""
    figure = PlainFigure(11.0, 7.0)
    limit = 4.0 * base.rmse
    for row, (made, title) in enumerate(((base, "before"), (final, "after"))):
        for column, channel in enumerate(("output_velocity", "time")):
            axes = figure.add_subplot(2, 2, 2 * row + column + 1)
            residual_over(made, channel, axes)
            axes.set_ylim(-limit, limit)
            titled(axes, f"{title}: RMSE {made.rmse:.4f} Nm")
    return figure


def _say_files(out: Path, say: Say) -> None:
    runs = f"{out / 'run1.csv'} ... run{TRAINING + HELD_OUT}.csv"
    say(f"\nLeft in {out}: model.json, report.html (open it in a browser), before_after.png,")
    say(f"joint.hpp, and the runs {runs}.")
    say("Next, the same by hand, and then with runs of your own:")
    say(f"  flexspline predict --model {out / 'model.json'} {out / 'run5.csv'} --out residual.csv")
    say("  flexspline fit --help")


def _held_out() -> str:
    return f"{TRAINING + 1} and {TRAINING + HELD_OUT}"


def _names(effects: Iterable[Effect]) -> str:
    """Names with commas, broken to lines that fit under the story's indent."""
    names = ", ".join(effect.name for effect in effects)
    return textwrap.fill(names, 84, initial_indent="   ", subsequent_indent="   ")
