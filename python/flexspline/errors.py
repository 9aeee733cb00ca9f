"""What flexspline says when its input is wrong: one sentence, with place and remedy."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from typing import Final

__all__ = [
    "FlexsplineWarning",
    "InputError",
    "above_zero",
    "did_you_mean",
    "in_unit",
    "listed",
    "number",
    "numbers",
    "one_line",
    "printable",
    "require_kind",
    "shortened",
]


LONGEST_WORD: Final = 200
"""Characters of one word in a sentence: a path or a cell may have thousands, and says no more."""
LONGEST_SENTENCE: Final = 2000
"""Characters of a sentence; the longest that lists all names of the catalogue has half of it."""


class InputError(ValueError):
    """The input or the call is wrong.

    The message is one sentence: which file, row, channel or option; what is wrong;
    what to do. The command line prints it and ends with exit code 2. Whatever it quotes,
    it is one line that a terminal can show, and no longer than a screen: see `one_line`.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class FlexsplineWarning(UserWarning):
    """Something works, but not as well as the caller may believe."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the known word nearest to `word`, or nothing."""
    near = difflib.get_close_matches(str(word), list(known), n=1, cutoff=0.6)
    return f" (did you mean '{near[0]}'?)" if near and near[0] != word else ""


def listed(words: Iterable[object], most: int = 20) -> str:
    """Return `words` joined by commas, the first `most` of them, for use in a sentence."""
    names = [str(word) for word in words]
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest if names else "nothing"


def printable(text: str) -> str:
    """Return a text on one line, a sign in place of each letter that a terminal obeys."""
    return "".join(map(_printable, text))


def one_line(message: str) -> str:
    """Return a sentence on one line without control characters, long words and quotes cut."""
    words = re.sub(rf"\S{{{LONGEST_WORD},}}", lambda found: shortened(found[0]), message)
    return printable(shortened(words, LONGEST_SENTENCE))


def shortened(value: object, most: int = 200) -> str:
    """Return a value as text for a sentence, the middle of a long one left out."""
    try:
        text = str(value)
    except ValueError:  # whole numbers of more digits than Python writes
        text = "a number of thousands of digits"
    half = most // 2
    return text if len(text) <= most else f"{text[:half]} … {text[-half:]}"


def number(value: object, name: str, unit: str = "") -> float:
    """Return a finite number; `name` is what the sentence calls it."""
    try:
        found = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if isinstance(value, (str, bytes, bool)) or not math.isfinite(found):
        raise InputError(
            f"{name} = {shortened(repr(value))} is no finite number; give one{in_unit(unit)}"
        )
    return found


def above_zero(value: object, name: str, unit: str = "", *, or_zero: bool = False) -> float:
    """Return a finite number above zero, or zero where that is allowed."""
    found = number(value, name, unit)
    if not (found > 0.0 or (or_zero and found == 0.0)):
        least = "zero or more" if or_zero else "a number above zero"
        raise InputError(f"{name} = {found:g} is not allowed; give {least}{in_unit(unit)}")
    return found


def numbers(values: Iterable[object], name: str, unit: str = "") -> tuple[float, ...]:
    """Return finite numbers as a tuple."""
    try:
        given = tuple(values)
    except TypeError:
        raise InputError(
            f"{name} = {shortened(repr(values))} is no list of numbers; give a list"
        ) from None
    return tuple(number(value, f"{name}[{i}]", unit) for i, value in enumerate(given))


def require_kind(value: object, kind: type, name: str) -> None:
    """Refuse an argument that is not of the class that holds it, such as a dictionary of options.

    `name` is what the sentence calls it; None is left out.
    """
    if value is not None and not isinstance(value, kind):
        raise InputError(f"{name} is a {type(value).__name__}; give {kind.__name__}(...)")


def in_unit(unit: str) -> str:
    """Return `` in Nm`` for use at the end of a sentence, or nothing."""
    return f" in {unit}" if unit else ""


def _printable(letter: str) -> str:
    if letter.isprintable():
        return letter
    return " " if letter.isspace() else "\N{REPLACEMENT CHARACTER}"
