"""The one door of names into XML: attributes and comments in which nothing of a name is markup."""

from __future__ import annotations

from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

from flexspline.errors import printable

__all__ = ["attributes", "comment"]


def attributes(values: Iterable[tuple[str, str]]) -> str:
    """Return attributes as a tag has them, `name="joint 7" axis="0 0 1"`, their values escaped."""
    return " ".join(f"{name}={quoteattr(printable(value))}" for name, value in values)


def comment(lines: Iterable[str], indent: str = "") -> str:
    """Return lines as a comment; two hyphens, which would end it, stand apart."""
    inside = [f"{indent}  {_apart(printable(line))}".rstrip() for line in lines]
    return "\n".join([f"{indent}<!--", *inside, f"{indent}-->"])


def _apart(text: str) -> str:
    while "--" in text:
        text = text.replace("--", "- -")
    return text
