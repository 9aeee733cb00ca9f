"""What flexspline says when its input is wrong: one sentence, with place and remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = [
    "FlexsplineWarning",
    "InputError",
    "did_you_mean",
    "listed",
    "printable",
    "shortened",
]


class InputError(ValueError):
    """The input or the call is wrong.

    The message is one sentence: which file, row, channel or option; what is wrong;
    what to do. The command line prints it and ends with exit code 2.
    """


class FlexsplineWarning(UserWarning):
    """Something works, but not as well as the caller may believe."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the known word nearest to `word`, or nothing."""
    near = difflib.get_close_matches(str(word), list(known), n=1, cutoff=0.6)
    return f" (did you mean '{near[0]}'?)" if near else ""


def listed(words: Iterable[object], most: int = 20) -> str:
    """Return `words` joined by commas, the first `most` of them, for use in a sentence."""
    names = [str(word) for word in words]
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest if names else "nothing"


def printable(text: str) -> str:
    """Return a text on one line, a sign in place of each letter that a terminal obeys."""
    return "".join(map(_printable, text))


def shortened(value: object, most: int = 200) -> str:
    """Return a value as text for a sentence, the middle of a long one left out."""
    text = str(value)
    half = most // 2
    return text if len(text) <= most else f"{text[:half]} … {text[-half:]}"


def _printable(letter: str) -> str:
    if letter.isprintable():
        return letter
    return " " if letter.isspace() else "\N{REPLACEMENT CHARACTER}"
