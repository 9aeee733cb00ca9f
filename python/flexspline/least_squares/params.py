"""The parameters of a fit by name: a read-only mapping that prints as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from flexspline.errors import InputError
from flexspline.rendering import render

if TYPE_CHECKING:
    import pandas

    from flexspline.least_squares.result import Fit, Parameter

__all__ = ["Params"]


class Params(Mapping[str, "Parameter"]):
    """The parameters of a fit by name, in the order of the effects.

    Names are those that the fit prints and that `fixed`, `bounds` and ``--fix`` take:
    "effect.term", a shape's name, or one part of a name where that is unique. Iteration gives full
    names. Each record has `value`, `stderr`, `unit`, `bounds`, `fixed`, `determined` and
    ``ci(level)``, see `Parameter`. The value of one that is not determined is what the model uses;
    it tells nothing of the joint, and its `stderr` and ``ci()`` are NaN.

    Raises
    ------
    InputError
        For a name that is no parameter's, or that may be several.
    """

    def __init__(self, fit: Fit) -> None:
        self._fit = fit

    def __getitem__(self, name: str) -> Parameter:
        return self._fit[name]

    def __iter__(self) -> Iterator[str]:
        return iter([parameter.name for parameter in self._fit.parameters])

    def __len__(self) -> int:
        return len(self._fit.parameters)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self.get(name) is not None

    def get(self, name: str, default: Any = None) -> Any:
        """Return a parameter, or `default` where the name is none or may be several."""
        try:
            return self[name]
        except InputError:
            return default

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters as a table; see `Fit.to_frame`."""
        return self._fit.to_frame()

    def __str__(self) -> str:
        return render("parameters", "text", self._fit)

    def __repr__(self) -> str:
        return f"<Params of {self._fit.target}: {len(self)} parameters>"

    def _repr_html_(self) -> str:
        return render("parameters", "html", self._fit)
