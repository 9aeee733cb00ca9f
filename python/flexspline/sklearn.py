"""A scikit-learn regressor: arrays in, arrays out, a joint's effects between.

    from flexspline.sklearn import JointRegressor

    joint = JointRegressor(["offset", "coulomb_friction"], columns=["output_velocity"])
    joint.fit(X, y).predict(X)

It finds the coefficients that `flexspline.fit` finds of the same rows read as recorded, and nothing
else: no standard errors, no checks of the log, no noise. It goes into pipelines, grid searches and
cross-validation. Rows of one recording are no independent samples: cross-validate by run
(``GroupKFold``), never shuffled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.effects import Effect
from flexspline.effects.causes import BASIC_FRICTION, OFFSET
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.fitting import solved, with_orders
from flexspline.least_squares.estimate import Given
from flexspline.least_squares.options import Bounds, shapes_of
from flexspline.least_squares.problem import problem_of
from flexspline.logs.channels import CHANNELS
from flexspline.logs.log import Fact, Log
from flexspline.model import Model, Part
from flexspline.signals import require_one_unit

try:
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError as error:
    raise ImportError(
        "flexspline.sklearn needs scikit-learn 1.6 or newer, which is not installed; run "
        "pip install 'flexspline[sklearn]'"
    ) from error

__all__ = ["JointRegressor"]

Array = NDArray[np.float64]

DERIVED = ("output_velocity", "output_acceleration")
LEAST_ROWS = 2


def __dir__() -> list[str]:
    return __all__


class JointRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Effects of a joint, fitted by least squares to arrays.

    Parameters
    ----------
    effects : names of `flexspline.CATALOGUE`, or `Effect` with shapes to start from and orders; an
        offset, Coulomb and viscous friction where nothing is given.
    target : what y is, as `flexspline.fit` defines it: "sensor_torque" [Nm], "motor_torque" [Nm at
        the output] or "motor_current" [A]; less the known load where there is one.
    columns : which channel each feature of X is, in its SI unit: a name for each feature, None for
        one that is not read; or {"output_velocity": 0}, from channel to feature by number or name.
        None: by the names of a data frame's columns.
    rate : Hz; the rows of X are consecutive samples of one run. None: rows are samples in any
        order, and what depends on the rows before (memory, time, a derivative) is refused, unless
        the channel "time" [s] is among the columns.
    known_load : channel among the columns that holds τ_load [Nm], for effects that read it.
    facts : {"gear_ratio": 100, "output_spline": "circular"}, as a log has them.
    orders, fixed, bounds : as `flexspline.fit` takes them. A ripple effect needs its orders.

    Attributes
    ----------
    model_ : `flexspline.Model`, to save and export.
    parameters_ : coefficients and shapes by the names that a fit prints.
    n_features_in_, feature_names_in_ : of X.

    Raises
    ------
    InputError
        From `fit` and `predict`: for unknown effects, channels or features, a channel that an
        effect needs and no feature gives, fewer rows than parameters, and rows that would have to
        be consecutive where no rate is given. It is a ValueError.
    """

    def __init__(
        self,
        effects: str | Effect | Sequence[str | Effect] = (OFFSET, *BASIC_FRICTION),
        *,
        target: str = "sensor_torque",
        columns: Sequence[str | None] | Mapping[str, int | str] | None = None,
        rate: float | None = None,
        known_load: str | None = None,
        facts: Mapping[str, Fact] | None = None,
        orders: Mapping[str, Sequence[int]] | None = None,
        fixed: Mapping[str, float] | None = None,
        bounds: Mapping[str, Bounds] | None = None,
    ) -> None:
        self.effects = effects
        self.target = target
        self.columns = columns
        self.rate = rate
        self.known_load = known_load
        self.facts = facts
        self.orders = orders
        self.fixed = fixed
        self.bounds = bounds

    def fit(self, X: ArrayLike, y: ArrayLike) -> JointRegressor:
        """Find the coefficients and shapes.

        Parameters
        ----------
        X : (N, features), finite.
        y : (N,), in the unit of the target.

        Returns
        -------
        JointRegressor
            Itself.
        """
        rows, values = validate_data(
            self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=LEAST_ROWS
        )
        effects = self._effects()
        log = self._log(rows, effects)
        log = log.with_columns({self.target: self._measured(log, values)}, note="y")
        problem = problem_of(
            [log], effects, self.target, known_load=self.known_load, lowpass_hz=None, threads=1
        )
        needed = problem.parameters(effects) + len(shapes_of(effects))
        if len(rows) < needed:
            raise InputError(
                f"X has {len(rows)} rows, but {needed} parameters need as many at least; give more "
                "rows or leave effects out"
            )
        given = Given(self.fixed or {}, self.bounds or {}, {}, False)
        _, made = solved(problem, effects, given, lambda: None)
        found = made.linear
        part = Part(self.target, found.effects, found.coefficients, self.known_load)
        self.model_ = Model({}).with_part(part, self.facts or {})
        shapes = {shape.name: shape.value(found.effects) for shape in made.shapes}
        coefficients = dict(zip(made.names, found.coefficients.tolist(), strict=True))
        self.parameters_ = {**coefficients, **shapes}
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Return y as the model predicts it, (N,), in the unit of the target.

        With a `rate` X is a run of its own: what effects remember starts anew with its first row.
        """
        check_is_fitted(self)
        rows = validate_data(self, X, dtype=np.float64, reset=False)
        log = self._log(rows, self.model_.part().effects)
        return self.model_.predict(log).predicted

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True  # on data that are of no joint
        return tags

    def _effects(self) -> list[Effect]:
        if self.target == "torsion":
            raise InputError(
                "target torsion is the difference of two angles and no y of its own; fit logs with "
                "flexspline.fit"
            )
        if self.target == "motor_current" and self.known_load is not None:
            raise InputError(
                "a known load of a motor current needs its torque constant; fit logs with "
                "flexspline.fit, or leave known_load out"
            )
        chosen = with_orders(self.effects, self.orders or {})
        if self.known_load is None:
            chosen = [effect.without_load() for effect in chosen]
        for effect in chosen:
            if effect.ripple and not effect.harmonics:
                raise InputError(
                    f"effect '{effect.name}' has no orders; give orders={{'{effect.name}': [1, 2]}}"
                )
        require_one_unit(chosen, self.target, self.known_load)
        return chosen

    def _log(self, rows: Array, effects: Sequence[Effect]) -> Log:
        """The rows as a log of the channels that they are."""
        channels = {name: rows[:, at] for name, at in self._places().items()}
        if "time" not in channels:
            if self.rate is None:
                _require_no_order(effects, channels)
            elif not (isinstance(self.rate, Real) and 0.0 < self.rate < float("inf")):
                raise InputError(f"rate is {self.rate!r}; give one above zero, in Hz, or None")
            channels["time"] = np.arange(len(rows)) / (self.rate or 1.0)
        facts = {"name": "X", **(self.facts or {})}
        return Log.from_arrays(facts=facts, **channels)

    def _places(self) -> dict[str, int]:
        """Number of the feature that is each channel; the target's own is not read."""
        names = list(getattr(self, "feature_names_in_", ()))
        columns = self.columns
        if columns is None:
            found = {name: at for at, name in enumerate(names) if name in CHANNELS}
            if not found:
                raise InputError(
                    "which channel is which feature is not known; give columns, such as "
                    "columns=['output_velocity', None], or a data frame with channels for columns"
                )
        elif isinstance(columns, Mapping):
            found = {name: self._place(at, names) for name, at in columns.items()}
        else:
            found = self._listed(columns)
        return {name: at for name, at in found.items() if name != self.target}

    def _place(self, at: int | str, names: Sequence[str]) -> int:
        if isinstance(at, str):
            if at not in names:
                raise InputError(
                    f"columns: X has no feature '{at}'{did_you_mean(at, names)}; it has "
                    f"{listed(names)}"
                )
            return names.index(at)
        if not 0 <= at < self.n_features_in_:
            raise InputError(
                f"columns: X has no feature {at}; it has 0 to {self.n_features_in_ - 1}"
            )
        return int(at)

    def _listed(self, columns: Sequence[str | None]) -> dict[str, int]:
        if not isinstance(columns, (list, tuple)) or len(columns) != self.n_features_in_:
            raise InputError(
                f"columns is {columns!r}, but X has {self.n_features_in_} features; give a channel "
                "or None for each"
            )
        named = [name for name in columns if name is not None]
        if len(set(named)) < len(named):
            raise InputError(f"columns is {columns!r}; name each channel once")
        return {name: at for at, name in enumerate(columns) if name is not None}

    def _measured(self, log: Log, y: Array) -> Array:
        """The target's channel of which y is made, in its own unit."""
        load = log[self.known_load] if self.known_load in log.channels else 0.0
        ratio = log.effective_ratio if self.target == "motor_torque" else 1.0
        return np.asarray((y + load) / (ratio or 1.0))


def _require_no_order(effects: Sequence[Effect], channels: Mapping[str, Array]) -> None:
    """Refuse effects for which the order of rows means something."""
    for effect in effects:
        derived = [name for name in DERIVED if name in effect.reads and name not in channels]
        if effect.info.remembers or "time" in effect.reads:
            what = "depends on time and on the rows before"
        elif derived and "output_position" in channels:
            what = f"needs {listed(derived)}, which would be derived from consecutive rows"
        else:
            continue
        raise InputError(
            f"effect '{effect.name}' {what}; give rate, where the rows are consecutive samples, or "
            "leave it out"
        )
