"""Fits by simulation on a measured servo: what each log is missed by, every start, every interval.

    python tests/bench/fit_by_simulation.py              # fits twelve XL330 logs, then four others
    python tests/bench/fit_by_simulation.py --choose     # how the model's form was chosen, minutes

The data are the XL330 logs of `../shared/data` (FLEXSPLINE_DATA says where else). The form of the
model was chosen by `--choose` on the twelve logs alone: the lowest mean, over the twelve, of the
RMS on the folds of runs that a fit did not count.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

import numpy as np
from xl330_servo import CHOSEN, FORMS, HELD_OUT, TWELVE, fitted, runs

import flexspline
from flexspline.least_squares.result import Fit, StartEnd


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--choose", action="store_true", help="cross-validate every form")
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    if given.choose:
        choose(given.starts, given.threads)
        return
    begin, busy = time.perf_counter(), time.process_time()
    fit = fitted(CHOSEN, starts=given.starts, threads=given.threads)
    begin, busy = time.perf_counter() - begin, time.process_time() - busy
    print(fit)
    print(f"\n{begin:.1f} s on the clock, {busy:.1f} s of processor, {given.threads} threads")
    intervals(fit)
    held_out(fit)


def choose(starts: int, threads: int) -> None:
    """Print the cross-validation of every form within the twelve."""
    print(f"{'form':<22}{'in-sample':>10}{'held out':>10}{'mean of logs':>14}   mrad RMS")
    for name in FORMS:
        found = fitted(name, starts=starts, threads=threads).simulation
        assert found is not None
        logs = 1e3 * np.array([run.held_out for run in found.runs])
        print(
            f"{name:<22}{1e3 * found.rmse:>10.1f}{1e3 * found.held_out:>10.1f}{logs.mean():>14.1f}"
            f"   {' '.join(f'{value:.0f}' for value in logs)}   {found.ends}",
            flush=True,
        )


def intervals(fit: Fit) -> None:
    """Print each interval beside what the fits without a fold found."""
    print(
        "\nparameter                          value        95 % interval         folds     inside"
    )
    found = fit.simulation
    assert found is not None
    for name, values in zip(found.names, found.folds.T, strict=True):
        low, high = fit[name].interval
        inside = bool(low <= values.min() and values.max() <= high)
        print(
            f"{name:<32}{fit[name].value:>9.4g}  {low:>9.4g} to {high:<9.4g}"
            f"{values.min():>9.4g} to {values.max():<9.4g} {inside}"
        )


def held_out(fit: Fit) -> None:
    """Print the RMS of the four logs that no choice has seen."""
    assert fit.simulation is not None
    made = flexspline.simulate(
        fit.model, runs(HELD_OUT), target="motor_torque", controller=fit.simulation.controller
    )
    squares = np.concatenate([run.residual**2 for run in made])
    each = [1e3 * run.rmse for run in made]
    print(f"\n{len(TWELVE)} logs fitted; four others, position simulated from the first row on:")
    for name, value in zip(HELD_OUT, each, strict=True):
        print(f"  {name}  {value:6.1f} mrad RMS")
    print(f"  mean      {np.mean(each):6.1f}")
    print(f"  all rows  {1e3 * np.sqrt(squares.mean()):6.1f}")
    print("\neach start: RMS on the twelve, then on the four, mrad")
    for start in fit.simulation.starts:
        print(f"  {1e3 * start.rmse:6.1f}  {1e3 * of_start(fit, start):6.1f}")


def of_start(fit: Fit, start: StartEnd) -> float:
    """Return the RMS [rad] on the four logs of the parameters that one start ended at."""
    assert fit.simulation is not None and fit.simulation.controller is not None
    values = dict(zip(fit.simulation.names, start.values, strict=True))
    names = [p.name for p in fit.parameters if p.kind == "coefficient"]
    there = [values.get(n, v) for n, v in zip(names, fit.part.coefficients, strict=True)]
    part = replace(fit.part, coefficients=np.array(there))
    law = fit.simulation.controller.with_fields(
        {n.removeprefix("controller."): v for n, v in values.items() if "controller." in n}
    )
    model = fit.model.with_part(part, {})
    made = flexspline.simulate(model, runs(HELD_OUT), target="motor_torque", controller=law)
    return float(np.sqrt(np.mean(np.concatenate([run.residual for run in made]) ** 2)))


if __name__ == "__main__":
    main()
