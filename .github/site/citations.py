"""Keys of the bibliography in a text, turned into citations."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

BIBLIOGRAPHY = Path(__file__).parents[1] / "REFERENCES.bib"
PAPERS = re.findall(r"^@\w+\{([a-z_]+),", BIBLIOGRAPHY.read_text(encoding="utf-8"), re.MULTILINE)
KEY = re.compile(rf"\[([A-Z][A-Za-z-]*\d{{4}})\]|\b({'|'.join(PAPERS)})\b")
CODE = re.compile(r"(`+[^`]+`+)")
IN_MARKDOWN = "{{cite:t}}`{}`"
IN_RST = ":cite:t:`{}`"


def cited(text: str, role: str, plain: Callable[[str], str] = str) -> str:
    """Return a text with its keys, `[Higham2002]` or a paper's name, in a role; code stays.

    `plain`: what is done to the words between keys.
    """
    made = []
    for k, piece in enumerate(CODE.split(text)):
        at = 0
        for key in KEY.finditer(piece) if k % 2 == 0 else ():
            made += [plain(piece[at : key.start()]), role.format(key[1] or key[2])]
            at = key.end()
        made.append(plain(piece[at:]) if k % 2 == 0 else piece)
    return "".join(made)
