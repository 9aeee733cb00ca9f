"""`flexspline fit` and `flexspline calibrate`: runs to a model and a report.

`fit` takes effects, `calibrate` the voltage of a sensor's bridge, temperature and a reference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flexspline.cli.options import (
    EFFECTS,
    FILE,
    Command,
    Reading,
    Taught,
    by_motion,
    effects_by_target,
    fitted_controller,
    loaded,
    named_effects,
    named_values,
    of_a_fit,
    on_terminal,
    out_file,
    positive,
    reading,
    refuse_overwriting,
    repairs,
    simulation,
    simulations,
    target,
    threads,
    whole_number,
)
from flexspline.cli.speech import found, say
from flexspline.effects import require_effects
from flexspline.errors import InputError
from flexspline.files import whole_folder

if TYPE_CHECKING:
    from flexspline.effects import Effect
    from flexspline.least_squares.options import FitOptions
    from flexspline.least_squares.profile import Contour, Profile
    from flexspline.least_squares.result import Fit

__all__ = ["calibrate", "fit"]


def _bound(text: str) -> tuple[float | None, float | None]:
    low, high = (None if not part.strip() else float(part) for part in text.split(":"))
    return low, high


def _prior(text: str) -> tuple[float, float]:
    value, error = (float(part) for part in text.split(":"))
    return value, error


def _names(text: str, option: str) -> tuple[str, ...]:
    """Read A,B; nothing of "".

    Raises
    ------
    InputError
        Where a name is missing.
    """
    names = tuple(name.strip() for name in text.split(",")) if text else ()
    if "" in names:
        raise InputError(f"{option} '{text}': a name is missing; write NAME or NAME,NAME")
    return names


def _pairs(texts: tuple[str, ...]) -> list[tuple[str, str]]:
    """Read what is written NAME,NAME."""
    found = []
    for text in texts:
        names = _names(text, "--contour")
        if len(names) != 2:
            raise InputError(f"--contour '{text}' names {len(names)}; write two, NAME,NAME")
        found.append((names[0], names[1]))
    return found


def _require_known(names: Sequence[str], effects: Sequence[Effect], option: str) -> None:
    """Refuse the name of no parameter before the fit; which run it is of is known behind it."""
    from flexspline.least_squares.options import coefficient_names, resolve, shapes_of

    known = [*coefficient_names(effects), *(shape.name for shape in shapes_of(effects))]
    words = {word for name in known for word in name.split(".")}
    for name in names:
        if name.split(".")[0] not in words:
            resolve(name, known, option)


def _require_profiled(
    options: Mapping[str, Any], effects: Sequence[Effect], runs: Sequence[str], how: FitOptions
) -> None:
    """Refuse, before the fit, what has no profile once the runs are known that have own terms."""
    from flexspline.least_squares.options import coefficient_names, resolve, shapes_of
    from flexspline.least_squares.per_run_terms import MANY_RUNS, own_terms

    own = own_terms(effects, how, [*options["fix"]], len(runs))
    shared = coefficient_names(effects, (), own)
    known = [*coefficient_names(effects, runs, own), *(s.name for s in shapes_of(effects))]
    asked = [(name, "--profile") for name in options["profiles"]]
    asked += [(name, "--contour") for pair in _pairs(options["contours"]) for name in pair]
    for name, option in asked:
        at = resolve(name, known, option)
        if len(runs) >= MANY_RUNS and len(shared) <= at < len(shared) + len(runs) * len(own):
            raise InputError(
                f"{option}: {known[at]} is a term of one of {len(runs)} runs, which has no profile "
                "of its own; use its interval"
            )


def _criteria(made: Fit) -> dict[str, float | None]:
    """AIC and BIC for a script; null of a fit that has none."""
    from flexspline.least_squares.likelihood import why_none

    if why_none(made):
        return {"aic": None, "bic": None}
    return {"aic": made.aic, "bic": made.bic}


def _beside(
    made: Fit, names: Sequence[str], pairs: Sequence[tuple[str, str]]
) -> tuple[list[Profile | Contour], list[str]]:
    """Profiles and regions of a fit, and why some that were asked for are none: the fit stands."""
    found: list[Profile | Contour] = []
    refused = []
    asked: list[tuple[str, tuple[str, ...]]] = [("--profile", (name,)) for name in names]
    asked += [("--contour", pair) for pair in pairs]
    for option, which in asked:
        try:
            one = made.profile(which[0]) if len(which) == 1 else made.contour(which[0], which[1])
            found.append(one)
        except InputError as error:
            refused.append(f"No {option} of {' and '.join(which)}: {error}.")
    return found, refused


def _regions(made: Sequence[Profile | Contour]) -> dict[str, list[dict[str, Any]]]:
    """Profiles and contours for a script, with their points."""
    import numpy as np

    found: dict[str, list[dict[str, Any]]] = {}
    for one in made:
        content = {field.name: getattr(one, field.name) for field in fields(one)}
        content = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in content.items()}
        kind = "contours" if "names" in content else "profiles"
        found.setdefault(kind, []).append(content)
    return found


def _refuse_of_motion(options: dict[str, Any], foreign: bool) -> None:
    """Refuse what a fit of the motion cannot take."""
    if foreign:
        raise InputError(
            "--by simulation drives the effects alone; leave the foreign simulation out"
        )
    if options["prior"]:
        raise InputError("--by simulation takes no --prior; fix or bound the parameter instead")
    if options["offset_per_run"] or options["per_run"]:
        given = "--offset-per-run" if options["offset_per_run"] else "--per-run"
        what = "one offset" if options["offset_per_run"] else "one value of each term"
        raise InputError(f"--by simulation takes {what} for all runs; leave {given} out")
    if options["profiles"] or options["contours"]:
        raise InputError(
            "--profile and --contour are of a regression; leave them out, or --by simulation"
        )


def _of_joint(content: Mapping[str, Any]) -> dict[str, Any]:
    """What a fit says of one joint: its errors, each parameter with its own, what is wrong."""
    unit = content["unit"]
    row = {"rmse": content["rmse"], "rmse_unit": unit}
    row |= {"held_out_rmse": content["held_out_rmse"], "held_out_rmse_unit": unit}
    for one in content["parameters"]:
        row |= {
            one["name"]: one["value"],
            f"{one['name']}_error": one["standard_error"],
            f"{one['name']}_unit": one["unit"],
        }
    return {**row, "remark": content["problems"]}


def _require_call(names: list[str], target: str, options: dict[str, Any], foreign: bool) -> None:
    """Refuse what is wrong whatever the runs hold, before they are read."""
    from flexspline.fitting import with_orders
    from flexspline.least_squares.options import Given, require_given

    effects = with_orders(names, options["orders"])
    require_effects(effects, target)
    if options["by"] == "simulation":
        _refuse_of_motion(options, foreign)
        return
    if options["controller"] or options["free_controller"]:
        raise InputError("--controller drives a simulation; give --by simulation or leave it out")
    pairs = _pairs(options["contours"])
    _require_known(options["profiles"], effects, "--profile")
    _require_known([name for pair in pairs for name in pair], effects, "--contour")
    if not (options["offset_per_run"] or options["per_run"]):  # with names of the runs
        if options["known_load"] is None:
            effects = [each.without_load() for each in effects]
        require_given(effects, Given(options["fix"], options["bound"], options["prior"], False))


@click.command(cls=Taught, sections=(effects_by_target, repairs))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@target(required=True)
@click.option(
    "--effects",
    "names",
    required=True,
    metavar="A,B,C",
    type=EFFECTS,
    help="Effects, listed below; or none.",
)
@out_file("DIR", "Folder for model.json and report.html.")
@click.option(
    "--into", metavar="MODEL.json", type=FILE, help="Add this part to a model of the same joint."
)
@of_a_fit
@named_values(
    "--bound",
    metavar="NAME=LOW:HIGH",
    parse=_bound,
    says="Limits of a parameter; either may be left out, as in viscous_friction=0:.",
)
@named_values(
    "--prior",
    metavar="NAME=VALUE:ERROR",
    parse=_prior,
    says="A value known beforehand, with its standard error.",
)
@click.option("--robust", is_flag=True, help="Weigh down outliers and pushes (Huber).")
@by_motion("Fit the torque, or from there on the motion that it makes when simulated.")
@fitted_controller
@whole_number(
    "--starts",
    1,
    default=8,
    says="By simulation: descents, from the regression, from pieces of the runs, and around.",
)
@simulation
@click.option("--offset-per-run", is_flag=True, help="One offset for each run.")
@click.option(
    "--per-run",
    metavar="NAME,NAME",
    default="",
    help="Terms that differ from run to run: offset (zeros), gravity,inertia (payloads).",
)
@click.option(
    "--profile",
    "profiles",
    multiple=True,
    metavar="NAME",
    help="Profile interval of a parameter, beside the Wald interval. Can be repeated.",
)
@click.option(
    "--contour",
    "contours",
    multiple=True,
    metavar="NAME,NAME",
    help="Joint confidence region of two parameters. Can be repeated.",
)
@click.option("--summary", is_flag=True, help="Print a page of statistics, with AIC and BIC.")
@threads
@reading(each_joint=_of_joint)
def fit(
    runs: tuple[str, ...],
    target: str,
    names: str,
    out: str,
    into: str | None,
    simulation: tuple[str, ...],
    simulated_torque: str | None,
    reading: Reading,
    **options: Any,
) -> None:
    """Fit physical effects to runs, all together.

    Reads the runs, checks them, fits the effects by least squares, and judges the fit on held-out
    rows. Prints the verdict: each term with its error and unit, what is indistinguishable in these
    runs, and where the error is largest. DIR receives model.json (the joint, all that predict and
    export need) and report.html (open it in a browser). A fit by simulation goes on from there
    until the simulated motion is the measured one, and leaves the law as servo.json. A
    sensor_torque that runs lack is read from their sensor_voltage by the calibration of --into.

    A run is a CSV file with one line of channel names (time, output_position, output_velocity,
    sensor_torque, ...) in SI units; lines "# gear_ratio: 100" above it give facts, which the
    options overrule. Other formats are read as well; name their columns by --columns.

    \b
    Examples:
      flexspline fit run1.csv run2.csv --target sensor_torque --gear-ratio 100 \\
          --effects offset,coulomb_friction,viscous_friction --out joint
      flexspline fit run1.csv --target motor_current --lowpass 5 \\
          --effects offset,coulomb_friction,gravity --repair drop_start=1 --out drive
      flexspline fit run*.csv --target sensor_torque --gear-ratio 100 --out joint \\
          --effects offset,viscous_friction,gravity --per-run offset,gravity
      flexspline fit run*.csv --target motor_torque --by simulation --gear-ratio 1 \\
          --controller servo.json --free-controller back_emf \\
          --effects inertia,gravity,coulomb_friction,load_dependent_friction --out servo
      flexspline fit robot.csv --columns map.toml --joint all --target sensor_torque \\
          --effects offset,coulomb_friction,viscous_friction --out robot
    """
    from flexspline.estimation import with_sensor_torque
    from flexspline.fitting import fit as fit_effects
    from flexspline.fitting import with_orders
    from flexspline.least_squares.options import FitOptions, MotionOptions

    effects, pairs = named_effects(names), _pairs(options["contours"])
    foreign = bool(simulation) or simulated_torque is not None
    _require_call(effects, target, options, foreign)
    model = None if into is None else loaded(into)
    refuse_overwriting(out, [*runs, *simulation], ("model.json", "report.html", "servo.json"))
    with whole_folder(out, last="model.json") as draft:
        column = None if simulation else simulated_torque
        logs = reading.logs(runs, {} if model is None else model.facts, column)
        if model is not None and target == "sensor_torque":
            logs = [with_sensor_torque(model, log) for log in logs]
        shared = {
            "known_load": options["known_load"],
            "lowpass": options["lowpass"],
            "orders": options["orders"],
            "fixed": options["fix"],
            "bounds": options["bound"],
            "into": model,
        }
        how = {
            "bandwidth": options["bandwidth"],
            "robust": "huber" if options["robust"] else None,
            "threads": options["threads"],
            "progress": on_terminal(),
        }
        made_elsewhere = simulations(simulation, simulated_torque)
        if options["by"] == "simulation":
            from flexspline.output_error.fitting import fit_motion

            free, starts = options["free_controller"], options["starts"]
            asked = MotionOptions(free_controller=free, starts=starts, **how)
            made = fit_motion(
                effects, logs, target, controller=options["controller"], options=asked, **shared
            )
        else:
            rest = FitOptions(
                offset_per_run=options["offset_per_run"],
                per_run=_names(options["per_run"], "--per-run"),
                simulation=made_elsewhere,
                simulated_torque=simulated_torque,
                **how,
            )
            chosen = with_orders(effects, options["orders"])
            _require_profiled(options, chosen, [log.name for log in logs], rest)
            made = fit_effects(
                effects, logs, target, priors=options["prior"], options=rest, **shared
            )
        if made.simulation is not None and made.simulation.controller is not None:
            made.simulation.controller.save(draft / "servo.json")
        beside, refused = _beside(made, options["profiles"], pairs)
        from flexspline.report.text import wrapped

        more: dict[str, Any] = {"beside": beside, "refused": refused} if beside or refused else {}
        made.report(draft / "report.html", **more)
        made.model.save(draft / "model.json")
        said = made.summary() if options["summary"] else str(made)
        told = [*(str(one) for one in beside), *refused]
        said = "\n\n".join([said, *("\n".join(wrapped(one)) for one in told)])

    from flexspline.report.text import SOUND, verdict

    judged = verdict(made)
    found(
        {
            "target": made.target,
            "unit": made.unit,
            "rmse": made.rmse,
            "held_out_rmse": made.cv_rmse,
            "verdict": judged.good,
            "problems": None if judged.wrong == SOUND else judged.wrong,
            "parameters": [parameter.to_json() for parameter in made.parameters],
            "per_run": [term.to_json() for term in made.between_runs],
            **(_criteria(made) if options["summary"] else {}),
            **_regions(beside),
            **({"refused": refused} if refused else {}),
        }
    )
    say(f"{said}\n\nwrote {Path(out) / 'model.json'} and {Path(out) / 'report.html'}")


NO_REFERENCE = "none"
FIT = "fit"
CONSTANTS = (
    "supply_voltage", "divider_resistance", "nominal_resistance", "beta", "nominal_temperature",
)  # fmt: skip


def _number_or_fit(ctx: click.Context, param: click.Parameter, text: str) -> float | str:
    """Read a number, or the word that asks for a fit."""
    if text == FIT:
        return text
    try:
        return float(text)
    except ValueError:
        raise click.BadParameter(f"'{text}' is no number and not '{FIT}'", ctx, param) from None


def _known_or_fitted(name: str, metavar: str, says: str) -> Callable[[Command], Command]:
    """An option that is a number, zero if not given, or the word that asks for a fit."""
    return click.option(
        name, default="0", show_default=True, metavar=metavar, callback=_number_or_fit, help=says
    )


def _thermistor(
    ctx: click.Context, param: click.Parameter, text: str | None
) -> dict[str, float] | None:
    """Read SUPPLY:DIVIDER:NOMINAL:BETA[:TEMPERATURE]."""
    if text is None:
        return None
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if len(values) not in (4, 5):
        raise click.BadParameter(
            f"'{text}' is not written SUPPLY:DIVIDER:NOMINAL:BETA, in V, Ω, Ω, K", ctx, param
        )
    return dict(zip(CONSTANTS, values, strict=False))


@click.command(cls=Taught, sections=(repairs,))
@click.argument("runs", nargs=-1, required=True, metavar="RUN.csv...", type=FILE)
@out_file("DIR", "Folder for model.json and report.html.")
@click.option(
    "--reference",
    default="reference_torque",
    show_default=True,
    metavar="CHANNEL",
    help="The trusted torque; none where all runs are without load.",
)
@click.option(
    "--into", metavar="MODEL.json", type=FILE, help="Add the estimators to a model of this joint."
)
@whole_number(
    "--degree",
    0,
    6,
    default=2,
    metavar="N",
    says="Of the drift's polynomial in temperature; 0 leaves temperature out.",
)
@click.option(
    "--reference-temperature",
    type=float,
    default=25.0,
    show_default=True,
    metavar="T0",
    help="°C, where the compensation is zero.",
)
@_known_or_fitted("--thermal-lag", "S|fit", "Lag of the elastic body behind the thermometer, s.")
@_known_or_fitted(
    "--gradient", "G|fit", "Nm per K that body and thermometer differ by; needs a lag."
)
@click.option(
    "--thermistor",
    metavar="VCC:RD:RN:B[:TN]",
    callback=_thermistor,
    help="Divider of runs with thermistor_voltage: supply V, divider Ω, nominal Ω, beta K, °C.",
)
@click.option(
    "--sensitivity", type=float, metavar="K", help="Nm/V, where it is known and not to be fitted."
)
@click.option(
    "--full-scale",
    type=positive,
    metavar="NM",
    help="What %FS are percent of; else the largest reference.",
)
@click.option(
    "--zero-per-run",
    is_flag=True,
    help="Each run has its own zero: mounted or zeroed again between runs.",
)
@reading()
def calibrate(
    runs: tuple[str, ...],
    out: str,
    into: str | None,
    reference: str,
    reading: Reading,
    **options: Any,
) -> None:
    """Calibrate a torque sensor, and compensate its drift with temperature.

    Reads runs with sensor_voltage, a reference torque and a temperature, fits sensitivity, zero
    and drift to all of them together, and prints the verdict: each number with its error,
    non-linearity, hysteresis and repeatability in %FS, what the runs cannot show and why. DIR
    receives model.json (with the estimators) and report.html.

    Runs of any kind may be mixed: steps or ramps of load, loading alone or with unloading, and
    runs without load while the temperature changes. Without any load the drift alone is fitted.
    Zeros that differ between runs are said; with --zero-per-run the model holds their mean.

    \b
    Examples:
      flexspline calibrate load.csv warmup.csv --full-scale 70 --out sensor
      flexspline calibrate warmup.csv --reference none --into sensor/model.json --out sensor2
      flexspline calibrate load.csv warmup.csv --thermal-lag fit --gradient fit --out sensor
    """
    model = None if into is None else loaded(into)
    refuse_overwriting(out, runs, ("model.json", "report.html"))
    with whole_folder(out, last="model.json") as draft:
        logs = reading.logs(runs, {} if model is None else model.facts)

        from flexspline.calibration import calibrate

        channel = None if reference.lower() == NO_REFERENCE else reference
        made = calibrate(logs, reference=channel, into=model, **options)
        made.report(draft / "report.html")
        made.model.save(draft / "model.json")
        verdict = str(made)
    found(
        {
            "unit": made.unit,
            "rmse": made.rmse,
            "parameters": [parameter.to_json() for parameter in made.parameters],
            "figures": [asdict(figure) for figure in made.figures],
            "warnings": made.warnings,
        }
    )
    say(f"{verdict}\n\nwrote {Path(out) / 'model.json'} and {Path(out) / 'report.html'}")
