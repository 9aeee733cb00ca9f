"""An effect of the user's own: a Python function of channels, with names and units.

    y = … + Σ_k c_k f_k(channels at this row; shapes)

The function gives the columns f_k, the fit finds the coefficients c_k and the shapes. It gets the
channels as effects of the catalogue do (what those read is smoothed alike, the same rows are left
out; channels that they do not read are as recorded), and pieces of runs as well as whole ones: each
row of its result is to follow from that row of its channels alone. What needs the rows before, such
as a loop or a lag, has no memory here.

A model's file keeps the effect's name, terms, channels and shapes, and never its function: nothing
that a file holds is run. Who loads such a model gives the function.

The effect's C++ header, if there is one, is compiled on this machine when it is given. It keeps the
contract of the catalogue's (`flexspline/effects/effect.hpp`): of an effect `hump` the file is
`hump.hpp` and the struct `flexspline::Hump`, a template of the number type, with the name, terms,
channels and shapes of the Python function. It includes no other file of the user's, so that it can
go beside an exported header. Only a path that a caller gives is compiled; a model's file has none.

`design_of` is the one door to rows of effects: the core's for the catalogue's, a function's for
one's own.
"""

from __future__ import annotations

import ctypes
import inspect
import math
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import (
    CATALOGUE,
    NO_TRAITS,
    TARGETS,
    Effect,
    EffectInfo,
    Harmonic,
    ShapeInfo,
    TermInfo,
    slices_of,
)
from flexspline.errors import InputError, did_you_mean, listed, one_line, shortened
from flexspline.files import refuse_special
from flexspline.logs.channels import CHANNELS
from flexspline.programs import STRICT, call, firmware_folder, host_compiler, include_folder

__all__ = [
    "Design",
    "Header",
    "Mixed",
    "OwnEffect",
    "compiled",
    "core_design",
    "declaration",
    "design_of",
    "is_own",
    "of_file",
    "own_effect",
    "own_effects",
]

Array = NDArray[np.float64]

POINTER = ctypes.POINTER(ctypes.c_double)

Function = Callable[..., Any]

TORQUES = ("sensor_torque", "motor_torque", "motor_current")
READABLE = tuple(name for name in CHANNELS if name != "simulated_torque")
NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
LONGEST = 64  # characters of a name
SYMBOLS = "1|Nm|rad|s|K|°C|A|V|kg|m|N"
FACTOR = rf"(?:{SYMBOLS})[²³]?"
UNIT = re.compile(rf"{FACTOR}(·{FACTOR})*(/({FACTOR}|\({FACTOR}(·{FACTOR})*\)))?")
SHARED = frozenset(s.name for info in CATALOGUE.values() for s in info.shapes if s.owner)
"""Shapes that effects of a model share: one of an effect alone has another name."""

PROBED = 50  # rows that are computed by themselves too
AGREEING = 1e-6  # of a column's size: what a header's rows may differ by, from its own tanh or exp
SAME = 1e-9  # of a column's size: what rows by themselves may differ by, from rounding
WHOLE = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


@dataclass(frozen=True)
class Header:
    """A header and the library that was made of it.

    `path`: as it was given. `text`: what was compiled. `reads`, `shapes`: in the header's order.
    """

    path: Path
    text: bytes
    reads: tuple[str, ...]
    shapes: tuple[str, ...]
    terms: int
    library: Any = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """Name of the file, as an exported header includes it."""
        return self.path.name

    def rows(self, channels: Mapping[str, Array], shapes: Mapping[str, float], size: int) -> Array:
        """Return the rows of the compiled effect, (size, terms)."""
        columns = [np.ascontiguousarray(channels[name], dtype=np.float64) for name in self.reads]
        values = np.array([shapes[name] for name in self.shapes])
        made = np.empty((size, self.terms))
        pointers = (POINTER * len(columns))(*map(_pointer, columns))
        self.library.flexspline_own_rows(size, pointers, _pointer(values), _pointer(made))
        return made


def compiled(path: str | os.PathLike[str], info: EffectInfo) -> Header:
    """Compile the header of an effect, and hold it to what the Python function says of itself.

    Raises
    ------
    InputError
        Where the file is not there or is called otherwise than the effect, the compiler is missing
        or refuses, or the header has other terms, channels or shapes.
    """
    file, label = Path(path), f"effect '{info.name}'"
    if file.name != f"{info.name}.hpp":
        raise InputError(f"{label}: its header is called {file.name}; call it {info.name}.hpp")
    refuse_special(file, "a C++ header")
    try:
        text = file.read_bytes()
    except OSError as error:
        raise InputError(
            f"{label}: its header {file} cannot be read ({error.strerror}); give a C++ header"
        ) from error
    with tempfile.TemporaryDirectory(prefix="flexspline-own-", ignore_cleanup_errors=True) as name:
        library = _library(file.resolve(), Path(name), info)
    said = [line.split("\t") for line in library.flexspline_own_description().decode().split("\n")]
    _require_same(info, file, said)
    reads, shapes = _named(said, "reads"), _named(said, "shape")
    return Header(file, text, reads, shapes, len(info.terms), library)


def _library(file: Path, folder: Path, info: EffectInfo) -> Any:
    """The header as a library, which stays loaded when its file is gone.

    Its names are hidden: the constants of another header's `Hump` would be taken for its own.
    """
    struct = "".join(word.capitalize() for word in info.name.split("_"))
    made = folder / f"{info.name}.so"
    options = ["-O2", "-fPIC", "-shared", "-fvisibility=hidden"]
    options += [f"-DFLEXSPLINE_OWN={struct}", f"-I{include_folder()}"]
    source = firmware_folder() / "own" / "rows.cpp"
    call(
        [host_compiler(), *STRICT.split(), *options, "-include", file, source, "-o", made],
        folder,
        does=f"effect '{info.name}': compiling {file}, struct flexspline::{struct}",
        remedy="correct the header",
    )
    library = ctypes.CDLL(str(made))
    library.flexspline_own_description.restype = ctypes.c_char_p
    library.flexspline_own_rows.argtypes = [
        ctypes.c_size_t,
        ctypes.POINTER(POINTER),
        POINTER,
        POINTER,
    ]
    library.flexspline_own_rows.restype = None
    return library


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(POINTER)


def _named(said: Sequence[Sequence[str]], what: str) -> tuple[str, ...]:
    return tuple(line[1] for line in said if line[0] == what)


def _require_same(info: EffectInfo, file: Path, said: Sequence[Sequence[str]]) -> None:
    """Refuse a header that says something else than the function beside it."""
    units = [(line[0], f"{line[1]} [{line[2]}]") for line in said[1:]]
    pairs = {
        "the name": ([said[0][1]], [info.name]),
        "the channels": (sorted(_named(said, "reads")), sorted(info.reads)),
        "the terms": (
            [text for what, text in units if what == "term"],
            [f"{term.name} [{term.unit}]" for term in info.terms],
        ),
        "the shapes": (
            [text for what, text in units if what == "shape"],
            [f"{shape.name} [{shape.unit}]" for shape in info.shapes],
        ),
    }
    for what, (there, here) in pairs.items():
        if there != here:
            raise InputError(
                f"effect '{info.name}': its header {file} has {what} {listed(there)}, and the "
                f"Python function {listed(here)}; make them the same, in the same order"
            )


@dataclass(frozen=True)
class Definition:
    """What an own effect says of itself, the function of its rows, and its header compiled."""

    info: EffectInfo
    function: Function
    header: Header | None = None


@dataclass(frozen=True, repr=False)
class OwnEffect(Effect):
    """An effect whose rows come from a function, see `own_effect`; otherwise as any `Effect`."""

    own: ClassVar[bool] = True

    definition: Definition = field(kw_only=True)

    def __call__(self, **shapes: float) -> OwnEffect:
        """Return the effect with some shapes set, to start from: ``hump(width=0.3)``."""
        made = self.with_shapes(**shapes)
        assert isinstance(made, OwnEffect)
        return made

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value:.4g}" for name, value in self.shapes.items())
        return f"{self.name}({given})"

    def __hash__(self) -> int:
        return super().__hash__()

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.name, dict(self.shapes), self.harmonics, self.definition)

    def __deepcopy__(self, memo: dict[int, Any]) -> OwnEffect:
        return self  # nothing in it changes, and a compiled header has no copy

    @property
    def info(self) -> EffectInfo:
        return self.definition.info

    @property
    def header(self) -> Header:
        """The effect's C++ header.

        Raises
        ------
        InputError
            Where it has none.
        """
        if self.definition.header is None:
            raise InputError(
                f"effect '{self.name}' is a Python function without a C++ header, which a device "
                f"needs; write {self.name}.hpp, and give it with header or with_header"
            )
        return self.definition.header

    def for_core(self) -> dict[str, Any]:
        raise InputError(
            f"effect '{self.name}' is your own, and this runs in the compiled core, which has the "
            "catalogue's effects alone; leave it out, or use fit, predict, compare or discover"
        )

    def with_header(self, path: str | os.PathLike[str]) -> OwnEffect:
        """Return the effect with its rows from a C++ header, which is compiled here and now.

        Parameters
        ----------
        path : as `own_effect` takes it.

        Raises
        ------
        InputError
            Where it does not compile, or says something else than the function.
        """
        made = compiled(path, self.info)
        return replace(self, definition=replace(self.definition, header=made))

    def columns(self, channels: Mapping[str, Array], size: int) -> Array:
        """Return the effect's columns, (size, terms), from channels (size,) in SI units.

        Raises
        ------
        InputError
            Where the function raises, or returns something else than a finite number for each row
            and term; rows of which a channel is not finite may be anything.
        """
        header = self.definition.header
        if header is None:
            return self._of_function(channels, size)
        return self._finite(header.rows(channels, self.shapes, size), channels)

    def _of_function(self, channels: Mapping[str, Array], size: int) -> Array:
        """The columns that the Python function gives."""
        if size == 0:
            return np.empty((0, len(self.terms)))
        given = {name: _unwritable(channels[name]) for name in self.info.reads}
        try:
            made = self.definition.function(**given, **self.shapes)
        except Exception as error:  # whatever a function of the user's raises
            said = shortened(one_line(str(error))) or "it says nothing"
            raise InputError(
                f"effect '{self.name}': its function ends with {type(error).__name__}: {said}; "
                "correct it"
            ) from error
        columns = _as_columns(made)
        if columns is None or columns.shape != (size, len(self.terms)):
            raise InputError(
                f"effect '{self.name}': its function returned {_described(made)} for {size} rows "
                f"and {_counted(self.terms)}; return real numbers, ({size},) for one term, else "
                "such an array for each, as a tuple"
            )
        return self._finite(columns, given)

    def _finite(self, values: Array, channels: Mapping[str, Array]) -> Array:
        """The values; refused where one is not finite and the channels of its row are."""
        whole = np.all([np.isfinite(channels[name]) for name in self.info.reads], axis=0)
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1) & whole)
        if len(bad):
            raise InputError(
                f"effect '{self.name}': it is not finite in {len(bad)} of {len(values)} rows, "
                f"first in row {bad[0]}; let it be a number wherever its channels are"
            )
        return values

    def require_by_row(self, channels: Mapping[str, Array], size: int, log: str) -> None:
        """Refuse a function whose rows depend on other rows, or differ from those of its header.

        Raises
        ------
        InputError
            As `columns`; where a row of the log computed by itself is another one, or one that is
            compiled from the header.
        """
        rows = np.unique(np.linspace(0, size - 1, PROBED).astype(np.intp))
        whole = self._of_function(channels, size)
        largest = np.abs(whole).max(axis=0, initial=0.0)
        if self.definition.header is not None:
            self._require_agreement(whole, self.columns(channels, size), log)
        few = {name: np.ascontiguousarray(channels[name][rows]) for name in self.info.reads}
        apart = np.abs(self._of_function(few, len(rows)) - whole[rows])
        if (apart > SAME * largest).any():
            raise InputError(
                f"effect '{self.name}': on log '{log}' a row of its function depends on other rows "
                "(a mean, a derivative, a sum); let each row follow from its own channels alone"
            )

    def _require_agreement(self, here: Array, there: Array, log: str) -> None:
        """Refuse rows of the header, `there`, that are not those of the function."""
        apart = np.abs(there - here)
        limit = AGREEING * np.maximum(np.abs(here), np.abs(there)).max(axis=0, initial=0.0)
        if (apart > limit).any():
            row, term = np.unravel_index(int(np.argmax(apart)), apart.shape)
            raise InputError(
                f"effect '{self.name}': in row {row} of log '{log}' {self.terms[term].name} of the "
                f"Python function is {here[row, term]:.6g} and of its header "
                f"{there[row, term]:.6g}; correct one of them"
            )

    def _require_known(self) -> None:
        """There is nothing to look up: the definition is here."""


def own_effect(
    *,
    terms: Mapping[str, str],
    shapes: Mapping[str, tuple[str, float, float]] | None = None,
    targets: Sequence[str] = TORQUES,
    name: str | None = None,
    header: str | os.PathLike[str] | None = None,
) -> Callable[[Function], OwnEffect]:
    """Make a Python function an effect that `fit`, `compare` and `discover` take as any other.

    The function's parameters say what it reads: those in `shapes` are numbers that a fit searches,
    all others are channels of a log, arrays (N,) in SI units. It returns an array (N,) for one
    term, else a tuple of one for each; each row follows from its own channels alone.

    Parameters
    ----------
    terms : name and unit of each coefficient, in the order of what the function returns; in Nm, or
        "Nm·s/rad" and the like, where the target is a torque or a current.
    shapes : unit, lowest and highest value of each shape, both above 0. A parameter's default is
        where its search starts; without one it starts in the middle, on a logarithmic scale.
    targets : what the effect may explain; all but the torsion.
    name : of the effect; None: that of the function.
    header : a C++ header beside the function, ``hump.hpp`` with ``flexspline::Hump`` for an effect
        ``hump``, as `flexspline/effects/effect.hpp` says. It is compiled at once, makes the rows
        from then on, is held to the function on every run of a fit, and lets a model be exported
        and certified. It includes the core's headers and the standard's alone.

    Returns
    -------
    A decorator that makes the function an `OwnEffect`. Called with shapes, this gives the effect
    that starts its search there.

    Raises
    ------
    InputError
        For a name that is taken or has anything but lower-case letters, digits and underscores, a
        unit that is not made of Nm, rad, s, K, °C, A, V, kg, m, N and 1, a parameter that is
        neither a channel nor a shape, bounds that leave no room, or a header that does not compile
        or says something else than the function.

    Examples
    --------
    >>> import numpy as np
    >>> @own_effect(terms={"height": "Nm"}, shapes={"width": ("rad/s", 0.01, 2.0)})
    ... def hump(output_velocity, width=0.2):
    ...     return output_velocity / width * np.exp(-((output_velocity / width) ** 2))
    >>> hump(width=0.3)
    hump(width=0.3)
    """

    def make(function: Function) -> OwnEffect:
        called = name if name is not None else getattr(function, "__name__", "")
        _require_name(called)
        known = dict(shapes or {})
        _require_terms(called, terms, known)
        _require_targets(called, targets)
        reads, starts = _parameters(called, function, known)
        info = EffectInfo(
            name=called,
            targets="".join(dict.fromkeys(TARGETS[target] for target in targets)),
            signature=(inspect.getdoc(function) or "").partition("\n")[0],
            source="the user's own",
            terms=tuple(TermInfo(term, unit) for term, unit in terms.items()),
            shapes=tuple(_shape(called, shape, known[shape], starts) for shape in known),
            reads=reads,
            pairs=(),
            traits=NO_TRAITS,
            remembers=False,
            modulated=False,
            paths=(),
            demands=(),
            reversal="",
            combines=(),
        )
        made = OwnEffect(called, definition=Definition(info, function))
        return made if header is None else made.with_header(header)

    return make


def declaration(effect: OwnEffect) -> dict[str, Any]:
    """Return what a model's file keeps of an own effect beside its name and values."""
    return {
        "reads": list(effect.info.reads),
        "terms": [{"name": term.name, "unit": term.unit} for term in effect.info.terms],
        "shapes": [{"name": shape.name, "unit": shape.unit} for shape in effect.info.shapes],
    }


def own_effects(given: OwnEffect | Iterable[OwnEffect]) -> tuple[OwnEffect, ...]:
    """Return the user's own effects that a call was given, one or several.

    Raises
    ------
    InputError
        For what is no such effect, or two of one name.
    """
    found: tuple[Any, ...] = (given,) if isinstance(given, (str, Effect)) else tuple(given)
    names = [getattr(one, "name", "") for one in found]
    for one in found:
        if not isinstance(one, OwnEffect):
            raise InputError(
                f"own holds {shortened(repr(one))}; give what flexspline.own_effect makes of a "
                "function: the catalogue's effects are known"
            )
        if names.count(one.name) > 1:
            raise InputError(f"effect '{one.name}' is twice in own; give it once")
    return found


def of_file(name: str, kept: Mapping[str, Any], given: Iterable[Effect]) -> OwnEffect:
    """Return the effect that a file calls its own, of those that the caller gives.

    Parameters
    ----------
    kept : its `declaration` in the file.

    Raises
    ------
    InputError
        Where none of this name is given, or one with other channels, terms or shapes.
    """
    own = {e.name: e for e in given if isinstance(e, OwnEffect)}
    if name not in own:
        raise InputError(
            f"effect '{name}' is a Python function, which no file keeps; load the model in Python "
            f"with it, as in Model.load(path, own=[{name}])"
        )
    there = declaration(own[name])
    for key, what in (("reads", "channels"), ("terms", "terms"), ("shapes", "shapes")):
        if there[key] != kept[key]:
            raise InputError(
                f"effect '{name}' of the file has the {what} {_listed(kept[key])}, and the one "
                f"that is given {_listed(there[key])}; give the one that the model was fitted with"
            )
    return own[name]


def _again(
    name: str, shapes: dict[str, float], harmonics: tuple[Harmonic, ...], definition: Definition
) -> OwnEffect:
    return OwnEffect(name, shapes, harmonics, definition=definition)


def _unwritable(values: Array) -> Array:
    """The values, so that a function which writes into its arguments changes no log."""
    view = values.view()
    view.flags.writeable = False
    return view


def _as_columns(made: Any) -> Array | None:
    """What a function returned as columns (N, T); None where it is not of real numbers."""
    try:
        found = np.column_stack(made) if isinstance(made, tuple) else np.asarray(made)
        values = found.astype(np.float64, casting="same_kind")
    except (TypeError, ValueError):
        return None
    return values[:, None] if values.ndim == 1 else values


def _described(made: Any) -> str:
    if isinstance(made, tuple):
        return f"a tuple of {len(made)}"
    kind = f"{made.dtype} of shape {made.shape}" if isinstance(made, np.ndarray) else ""
    return f"an array of {kind}" if kind else f"a {type(made).__name__}"


def _counted(terms: Sequence[TermInfo]) -> str:
    return f"{len(terms)} term{'' if len(terms) == 1 else 's'}"


def _listed(entries: Sequence[Any]) -> str:
    said = (e if isinstance(e, str) else f"{e['name']} [{e['unit']}]" for e in entries)
    return listed(said)


def _require_name(name: object, what: str = "effect", of: str = "") -> None:
    if not isinstance(name, str) or not NAME.fullmatch(name) or len(name) > LONGEST:
        raise InputError(
            f"{of}{what} {shortened(ascii(name), 80)} is no name; give lower-case letters, digits "
            f"and single underscores between them, beginning with a letter, {LONGEST} at most"
        )
    if what == "effect" and name in CATALOGUE:
        raise InputError(f"effect '{name}' is one of the catalogue; give your own another name")


def _require_unit(unit: object, what: str) -> None:
    if not isinstance(unit, str) or not UNIT.fullmatch(unit):
        raise InputError(
            f"{what} has the unit {shortened(ascii(unit), 80)}, which is none; make it of "
            f"{listed(SYMBOLS.split('|'))}, as in Nm·s/rad or Nm/(rad·K²)"
        )


def _require_terms(
    name: str, terms: Mapping[str, str], shapes: Mapping[str, tuple[str, float, float]]
) -> None:
    if not isinstance(terms, Mapping) or not terms:
        raise InputError(
            f"effect '{name}' has no terms; give name and unit of each coefficient, as in "
            "terms={'height': 'Nm'}"
        )
    for term, unit in terms.items():
        _require_name(term, "term", f"effect '{name}': ")
        _require_unit(unit, f"effect '{name}': term '{term}'")
    for shape in shapes:
        _require_name(shape, "shape", f"effect '{name}': ")
        if shape in terms or shape in SHARED:
            whose = "one of its terms" if shape in terms else "a shape that other effects share"
            raise InputError(f"effect '{name}': shape '{shape}' is called as {whose}; rename it")


def _require_targets(name: str, targets: Sequence[str]) -> None:
    if isinstance(targets, str) or not targets or not {*targets} <= {*TARGETS}:
        raise InputError(
            f"effect '{name}' has the targets {shortened(repr(targets), 80)}; give a list of "
            f"{listed(TARGETS)}"
        )


def _parameters(
    name: str, function: Function, shapes: Mapping[str, Any]
) -> tuple[tuple[str, ...], dict[str, Any]]:
    """The channels that a function reads, and where the search for its shapes starts."""
    if not callable(function):
        raise InputError(f"effect '{name}' is a {type(function).__name__}; give a function")
    reads, starts = [], {}
    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError) as error:
        raise InputError(
            f"effect '{name}': its function does not say what it takes; write one with def, with a "
            "parameter for each channel and shape"
        ) from error
    for parameter in parameters.values():
        if parameter.kind not in WHOLE:
            raise InputError(
                f"effect '{name}': its function takes {parameter}, which no name gives; write a "
                "parameter for each channel and shape"
            )
        if parameter.name in shapes:
            if parameter.default is not parameter.empty:
                starts[parameter.name] = parameter.default
        elif parameter.name in READABLE:
            reads.append(parameter.name)
        else:
            near = did_you_mean(parameter.name, [*READABLE, *shapes])
            raise InputError(
                f"effect '{name}': its function takes '{parameter.name}'{near}, which is neither a "
                f"channel nor one of its shapes; channels are {listed(READABLE)}"
            )
    missing = [shape for shape in shapes if shape not in parameters]
    if missing:
        raise InputError(
            f"effect '{name}': its function does not take the shape '{missing[0]}'; add it to the "
            "function's parameters, or leave the shape out"
        )
    if not reads:
        raise InputError(
            f"effect '{name}': its function reads no channel; let it take one, such as "
            "output_velocity"
        )
    return tuple(reads), starts


def _shape(name: str, shape: str, given: Any, starts: Mapping[str, Any]) -> ShapeInfo:
    try:
        unit, lower, upper = given
        low, high = float(lower), float(upper)
        start = float(starts.get(shape, math.sqrt(low * high) if low * high >= 0.0 else math.nan))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"effect '{name}': shape '{shape}' is {shortened(repr(given), 80)}; give its unit, "
            "lowest and highest value, as in ('rad/s', 0.01, 2.0)"
        ) from error
    _require_unit(unit, f"effect '{name}': shape '{shape}'")
    if not 0.0 < low < high < math.inf:
        raise InputError(
            f"effect '{name}': shape '{shape}' goes from {low:g} to {high:g}; give bounds above 0, "
            "the lower one first: it is searched on a logarithmic scale"
        )
    if not low <= start <= high:
        raise InputError(
            f"effect '{name}': shape '{shape}' starts at {start:g}, which is not within {low:g} to "
            f"{high:g}; give a default in that range"
        )
    return ShapeInfo(shape, unit, start, low, high, True, "")


class Mixed:
    """Effects of the catalogue and of the user's own, with the methods of the core's design.

    Own effects read channels alone and carry no load, so that the rows of the others are those of
    a design without them.
    """

    def __init__(self, effects: Sequence[Effect], gear: Mapping[str, Any]) -> None:
        self._core = core_design([e for e in effects if not e.own], gear)
        self._own: list[tuple[OwnEffect, slice]] = []
        own = is_own(effects)
        self._of_core = np.flatnonzero(~own)
        self._of_own = np.flatnonzero(own)
        self.columns = len(own)
        for effect, at in zip(effects, slices_of(effects), strict=True):
            if isinstance(effect, OwnEffect):
                self._own.append((effect, at))

    def rows(self, channels: dict[str, Array], size: int, coefficients: Array) -> Array:
        """Design matrix, shape (size, columns)."""
        made = np.empty((size, self.columns), order="F")
        made[:, self._of_core] = self._core.rows(channels, size, self._core_of(coefficients))
        for effect, at in self._own:
            made[:, at] = effect.columns(channels, size)
        return made

    def predict(self, channels: dict[str, Array], size: int, coefficients: Array) -> Array:
        """Rows times coefficients, shape (size,)."""
        values = np.array(self._core.predict(channels, size, self._core_of(coefficients)))
        for effect, at in self._own:
            values += effect.columns(channels, size) @ coefficients[at]
        return values

    def settled(
        self, channels: dict[str, Array], size: int, coefficients: Array
    ) -> NDArray[np.bool_]:
        """Rows that no longer depend on what an effect remembered before its run, (size,)."""
        made = self._core.settled(channels, size, self._core_of(coefficients))
        return np.asarray(made)

    def accumulate(
        self,
        channels: dict[str, Array],
        target: Array,
        blocks: Sequence[tuple[int, int]],
        coefficients: Array,
        held: Array,
        weights: Array | None,
        double_double: bool,
        structured: bool,
        threads: int,
    ) -> tuple[Array, Array]:
        """Sums of products of [rows, target] of each block: (high, low)."""
        rows = self.rows(channels, len(target), coefficients)
        left = target - rows @ held if held.size else target
        if weights is not None and double_double:
            root = np.sqrt(weights)
            rows, left, weights = rows * root[:, None], left * root, None
        return _core.accumulate_rows(rows, left, blocks, weights, double_double, threads)

    def _core_of(self, coefficients: Array) -> Array:
        return coefficients[self._of_core] if coefficients.size else coefficients


Design: TypeAlias = _core.Design | Mixed


def design_of(effects: Sequence[Effect], gear: Mapping[str, Any]) -> Design:
    """Return what makes the rows of effects.

    Parameters
    ----------
    gear : as `_core.Design` takes it: effective ratio, output spline, whether the motor's angle is
        measured.
    """
    own = any(effect.own for effect in effects)
    return Mixed(effects, gear) if own else core_design(effects, gear)


def core_design(effects: Sequence[Effect], gear: Mapping[str, Any]) -> _core.Design:
    """Return the design of effects of the catalogue, as `design_of` does."""
    return _core.Design([effect.for_core() for effect in effects], **gear)


def is_own(effects: Sequence[Effect]) -> NDArray[np.bool_]:
    """Return for each column of effects whether it is one of an own effect, (P,)."""
    return np.array([effect.own for effect in effects for _ in effect.terms], dtype=bool)
