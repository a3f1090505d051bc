"""JSON that every reader accepts.

Python writes NaN and lone surrogates, which JSON lacks, and refuses keys and values that YAML has, such as dates.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def json_text(data: object, indent: int | None = None) -> str:
    """Return data as JSON in UTF-8, on one line unless `indent` is given.

    NaN and infinities are written as in protobuf's JSON: "NaN", "Infinity", "-Infinity". Other values that JSON lacks
    are written as strings, and a lone surrogate as "?".
    """
    options: Any = {"indent": indent, "allow_nan": False, "ensure_ascii": False, "default": str}
    try:
        text = json.dumps(data, **options)
    except (ValueError, TypeError):
        text = json.dumps(_plain(data), **options)
    return text.encode("utf-8", "replace").decode("utf-8")


def _plain(data: object) -> object:
    """Return data without values or keys that JSON lacks."""
    if isinstance(data, Mapping):
        return {_key(key): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [*map(_plain, data)]
    return _number(data) if isinstance(data, float) and not math.isfinite(data) else data


def _key(key: object) -> object:
    return key if isinstance(key, int) or key is None else str(key)


def _number(value: float) -> str:
    if math.isnan(value):
        return "NaN"
    return "Infinity" if value > 0 else "-Infinity"
