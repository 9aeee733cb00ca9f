"""Calls as they were before 0.1; each warns, and goes with version 0.2."""

from __future__ import annotations

import functools
import warnings
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar, cast

from flexspline import fitting
from flexspline.errors import InputError
from flexspline.least_squares.options import FitOptions, MotionOptions

if TYPE_CHECKING:
    from collections.abc import Callable

    from flexspline.least_squares.result import Fit

__all__ = ["fit"]

Call = TypeVar("Call", bound="Callable[..., Fit]")

OF_FIT = frozenset(field.name for field in fields(FitOptions))
OF_MOTION = frozenset({"by", "controller", "free_controller", "starts", "folds", "seed"})


def _with_old_names(call: Call) -> Call:
    """Let `fit` take its options by their own names, and by="simulation"."""

    @functools.wraps(call)
    def taken(*args: Any, **given: Any) -> Fit:
        old = {name: given.pop(name) for name in [*given] if name in OF_FIT | OF_MOTION}
        if not old:
            return call(*args, **given)
        if "options" in given:
            raise InputError(f"{_listed(old)} is given beside options; give it inside")
        by = old.pop("by", "regression")
        if by not in ("regression", "simulation"):
            raise InputError(f"by is {by!r}; leave it out, or call fit_motion")
        if by == "simulation":
            return _motion(args, given, old)
        motion = [name for name in ("controller", "free_controller") if old.pop(name, None)]
        if motion:
            raise InputError(f"{_listed(motion)} is of a simulated motion; call fit_motion")
        old = {name: value for name, value in old.items() if name in OF_FIT}
        _warn("give fit what few calls need as options=FitOptions(...), and leave out by", 3)
        return call(*args, **given, options=FitOptions(**old))

    return cast(Call, taken)


def _motion(args: Any, given: dict[str, Any], old: dict[str, Any]) -> Fit:
    from flexspline.output_error.fitting import fit_motion

    _warn("call fit_motion instead of fit with by='simulation'", 4)
    controller = old.pop("controller", None)
    known = {field.name for field in fields(MotionOptions)}
    priors = {"priors": given.pop("priors")} if "priors" in given else {}
    others = {name: old.pop(name) for name in [*old] if name not in known} | priors
    if refused := [name for name, value in others.items() if value]:
        raise InputError(f"a fit of the motion takes no {_listed(refused)}; leave it out")
    return fit_motion(*args, **given, controller=controller, options=MotionOptions(**old))


def _listed(names: Any) -> str:
    return ", ".join(names)


def _warn(sentence: str, level: int) -> None:
    warnings.warn(f"{sentence}; the old form ends with version 0.2", DeprecationWarning, level)


fit = _with_old_names(fitting.fit)
