"""One figure of a fit: how good it is, where it is not, and what it is made of."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from flexspline.errors import InputError
from flexspline.plot.canvas import Panel, panelled
from flexspline.plot.components import components
from flexspline.plot.drift import drift_curve
from flexspline.plot.motion import simulated_motion
from flexspline.plot.orders import order_spectra
from flexspline.plot.residuals import has_channel, measured_against_predicted, residual_over

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["panels", "plot_fit"]

LOOK_FOR = {
    "worst": "The run whose simulated motion is off most. Both lines start together; where they "
    "part is where the model errs first, what follows is also the error carried on.",
    "median": "A run in the middle: this is what to expect of the next one.",
    "predicted": "All points should lie along the diagonal. A cloud that bends or lies beside it "
    "is an effect the model lacks; a run apart from the others is a run unlike them.",
    "time": "The residual should be equally wide everywhere and centred on zero. A slow drift is "
    "temperature or time; a burst is a push, a reversal or a fault of the log.",
    "output_position": "The median should lie on zero at every angle. Waves are ripple that the "
    "model lacks, one period a turn is gravity.",
    "output_velocity": "The median should lie on zero at every speed. A step at zero is Coulomb "
    "friction, a slope viscous friction, a peak at low speed Stribeck friction.",
    "temperature": "The median should lie on zero at every temperature. A slope is drift.",
    "components": "What the prediction is made of. Effects that these runs cannot tell apart are "
    "drawn as their sum.",
    "components over": "The median contribution at each speed; a band holds 90 % where an effect "
    "depends on more than the speed.",
    "orders": "Lines of the target that the residual no longer has are explained. A line that is "
    "left is a ripple the model lacks; its order says what turns.",
    "drift": "The reading without the other effects should follow the curve; the band holds the "
    "true curve with 95 %.",
}


def plot_fit(fit: Fit) -> Figure:
    """Return a figure with a panel for each view that the channels of the runs allow."""
    return panelled(panels(fit), 3.5)


def panels(fit: Fit) -> list[Panel]:
    """Return the views that the channels of the runs allow."""
    found = [
        *_motion(fit),
        Panel(partial(measured_against_predicted, fit), LOOK_FOR["predicted"]),
        Panel(partial(residual_over, fit, "time"), LOOK_FOR["time"]),
    ]
    for channel in ("output_position", "output_velocity", "temperature"):
        if has_channel(fit, channel):
            found.append(Panel(partial(residual_over, fit, channel), LOOK_FOR[channel]))
    if fit.part.effects:
        found.append(Panel(partial(components, fit, "time"), LOOK_FOR["components"]))
        if all("output_velocity" in run.log for run in fit.runs):
            over = partial(components, fit, "output_velocity")
            found.append(Panel(over, LOOK_FOR["components over"]))
    if "temperature_drift" in [effect.name for effect in fit.part.effects]:
        logs = [run.log for run in fit.runs]
        found.append(Panel(partial(drift_curve, fit, logs), LOOK_FOR["drift"]))
    if _turns(fit):
        found.append(Panel(partial(order_spectra, fit), LOOK_FOR["orders"]))
    return found


def _motion(fit: Fit) -> list[Panel]:
    """Of a fit by simulation the run that it misses most, and one in the middle."""
    if fit.simulation is None:
        return []
    shown = ("worst", "median") if len(fit.runs) > 1 else ("worst",)
    return [Panel(partial(simulated_motion, fit, run), LOOK_FOR[run]) for run in shown]


def _turns(fit: Fit) -> bool:
    """Whether the runs turn the joint far enough, with an angle, for orders to be seen."""
    try:
        order_spectra(fit)
    except InputError:
        return False
    return True
