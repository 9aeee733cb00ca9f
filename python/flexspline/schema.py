"""The schema of `model.json`, and the sentence for what does not fit it."""

from __future__ import annotations

import importlib.resources
import json
from functools import cache
from typing import Any

import jsonschema

from flexspline.errors import InputError, shortened

__all__ = ["require_schema"]


def require_schema(content: dict[str, Any], label: str) -> None:
    """Refuse content that is no model; `label` is what the sentence calls it."""
    errors = jsonschema.Draft202012Validator(_schema()).iter_errors(content)
    first = jsonschema.exceptions.best_match(errors)
    if first is not None:
        where = "/".join(str(part) for part in first.absolute_path) or "the top"
        wrong = shortened(first.message)
        raise InputError(f"{label}: at {where}: {wrong}; mend it or fit the model again")


@cache
def _schema() -> dict[str, Any]:
    file = importlib.resources.files("flexspline") / "schemas" / "model.schema.json"
    content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return content
