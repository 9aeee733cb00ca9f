"""What flexspline says when its input is wrong: one sentence, with place and remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["FlexsplineWarning", "InputError", "did_you_mean", "listed"]


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
