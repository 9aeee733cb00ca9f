"""JSON Schema checks: what JSON files may hold, and the sentence for a violation in `model.json`.

JSON knows no NaN, no tuples and no numpy numbers.
"""

from __future__ import annotations

import importlib.resources
import json
import math
import re
from collections.abc import Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from flexspline.errors import InputError, shortened

__all__ = [
    "checked_json",
    "json_content",
    "plain_json",
    "require_schema",
]

SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")  # an escape that may be half of a character


def json_content(text: str, label: str) -> object:
    """Return what a JSON text holds; `label` is what errors call it.

    Raises
    ------
    InputError
        Where the text is no JSON, or holds a number that no double can.
    """
    try:
        content: object = json.loads(
            text,
            parse_constant=partial(_no_constant, label),
            parse_int=partial(_number, label, int),
            parse_float=partial(_number, label, float),
        )
        if SURROGATE.search(text):
            json.dumps(content, ensure_ascii=False).encode()
    except RecursionError as error:
        raise InputError(f"{label}: is nested too deep; give a model.json") from error
    except UnicodeEncodeError as error:
        raise InputError(
            f"{label}: holds half of a character (U+D800 to U+DFFF); correct it or fit again"
        ) from error
    except json.JSONDecodeError as error:
        raise InputError(
            f"{label}: is no JSON (line {error.lineno}, column {error.colno}); give a model.json"
        ) from error
    return content


def require_schema(content: dict[str, Any], label: str) -> None:
    """Refuse content that is no model; `label` is what the sentence calls it."""
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    first = best_match(Draft202012Validator(_schema("model")).iter_errors(content))
    if first is not None:
        where = "/".join(str(part) for part in first.absolute_path) or "the top"
        wrong = shortened(first.message)
        raise InputError(f"{label}: at {where}: {wrong}; correct it or fit the model again")


def checked_json(content: Any, schema: str) -> str:
    """Return content as JSON text that fits "comparison" or "discovery"; no NaN, no tuple in it."""
    from jsonschema import Draft202012Validator

    content = plain_json(content)
    Draft202012Validator(_schema(schema)).validate(content)
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


@cache
def _schema(name: str) -> dict[str, Any]:
    file = importlib.resources.files("flexspline") / "schemas" / f"{name}.schema.json"
    content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return content


def _no_constant(label: str, word: str) -> float:
    raise InputError(f"{label}: holds {word}, which is no JSON number; fit the model again")


def _number(label: str, kind: type[int] | type[float], word: str) -> int | float:
    """The number of a word; one beyond a double's range is refused."""
    if not math.isfinite(float(word)):
        raise InputError(
            f"{label}: holds {shortened(word, 40)}, which is beyond the range of a double; "
            "fit the model again"
        )
    return kind(word)


def plain_json(value: Any) -> Any:
    """Turn what JSON has no word for into null, tuples into lists, numpy numbers into numbers."""
    if isinstance(value, Mapping):
        return {str(key): plain_json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_json(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
