"""The one door through which text leaves for C++: names, literals, includes and comments.

A model file is data that somebody else wrote. Whatever its texts hold, an exported header has the
declarations that its writers put there and no others: what becomes a name is refused unless it is
one, what becomes a string is escaped, and what becomes a comment stays within its line.
"""

from __future__ import annotations

import re
from pathlib import PurePath

from flexspline.errors import InputError, shortened
from flexspline.exporting.cpp_names import WORDS, is_taken

__all__ = [
    "boolean",
    "comment",
    "identifier",
    "include",
    "literal",
    "namespace_name",
    "number",
    "string_literal",
    "whole",
]

LARGEST = float.fromhex("0x1.fffffep+127")  # the largest float
LONGEST = 64  # characters of a name
IDENTIFIER = re.compile(r"(?!.*__)[A-Za-z][A-Za-z0-9_]*")
HEADER = re.compile(r"(?!.*\.\.)[A-Za-z0-9_][A-Za-z0-9_.-]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)*")
PLAIN = re.compile(r"[ !#->@-\[\]-~]")  # of ASCII, without quote, question mark and backslash


def identifier(text: str) -> str:
    """Return a name that C++ can declare, or refuse the text.

    Raises
    ------
    InputError
        Where the text has anything but ASCII letters, digits and single underscores, is longer than
        64 characters, or is a word of C++.
    """
    if len(text) > LONGEST or not IDENTIFIER.fullmatch(text) or text in WORDS:
        raise InputError(
            f"{shortened(ascii(text), 80)} is no name that C++ can hold; give letters, digits and "
            "single underscores, and no word of C++"
        )
    return text


def namespace_name(stem: str) -> str:
    """Return a namespace for the stem of a file: "joint 7" is "joint_7", "gamma" "gamma_model"."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", stem)[: LONGEST - len("joint__model")].strip("_")
    name = name or "model"
    if name[0].isdigit():
        name = f"joint_{name}"
    return identifier(f"{name}_model" if is_taken(name) else name)


def string_literal(text: str) -> str:
    """Return a narrow string literal of the text in UTF-8."""
    return '"' + "".join(map(_escaped, text)) + '"'


def include(name: str | PurePath) -> str:
    """Return the line that includes a header.

    Raises
    ------
    InputError
        Where its name has anything but letters, digits and ``_ - . /``.
    """
    if not HEADER.fullmatch(str(name)):
        raise InputError(f"{shortened(ascii(str(name)), 80)} is no name of a header")
    return f'#include "{name}"'


def comment(text: str) -> str:
    """Return the text in a form that stays inside a comment and its line.

    Control characters, line and paragraph separators, and marks that turn the direction of writing
    become blanks; a backslash, which would join the next line, becomes a slash; the marks of a
    trigraph and of a block comment are parted.
    """
    text = "".join(letter if letter.isprintable() else " " for letter in text)
    text = text.replace("\\", "/")
    return re.sub(r"\?(?=\?)|\*(?=/)|/(?=\*)", r"\g<0> ", text)


def literal(value: float, name: str) -> str:
    """The shortest decimal that reads back as the same double, as a number of type S.

    Raises
    ------
    InputError
        Where no float holds it; `name` is what the sentence calls it.
    """
    if not abs(value) <= LARGEST:
        raise InputError(f"{name} = {value} does not fit into a float; fit the model again")
    return f"S({number(value, name)})"


def number(value: float, name: str) -> str:
    """The shortest decimal of a finite number that reads back as the same double."""
    made = float(value)
    if not abs(made) < float("inf"):
        raise InputError(f"{name} = {made} is not finite; give a number")
    return repr(made)


def whole(value: int) -> str:
    """A whole number."""
    return str(int(value))


def boolean(value: bool) -> str:
    """True or false."""
    return "true" if value else "false"


def _escaped(letter: str) -> str:
    if PLAIN.fullmatch(letter):
        return letter
    return "".join(f"\\{byte:03o}" for byte in letter.encode(errors="replace"))
