"""SHA-256 digests of bytes and of plain data, in hexadecimal digits, and the default folder for cached results.

Every hit loads this module, so it imports as little of Python's standard library as possible.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping

_DIGITS = frozenset("0123456789abcdef")
_DIGEST_DIGITS = 64


def digest(data: bytes) -> str:
    """Return the SHA-256 of bytes in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def digest_of(data: object) -> str:
    """Return the SHA-256 of plain data in hexadecimal digits."""
    return digest(json.dumps(data, sort_keys=True).encode())


def is_digest(text: object) -> bool:
    """Return whether a value is a SHA-256 in hexadecimal digits."""
    return isinstance(text, str) and len(text) == _DIGEST_DIGITS and _DIGITS.issuperset(text)


def default_root(environment: Mapping[str, str] = os.environ) -> str:
    """Return the store's absolute path: FUSESOC_FIRM_CACHE, by default `fusesoc_firm` in XDG_CACHE_HOME or ~/.cache."""
    if chosen := environment.get("FUSESOC_FIRM_CACHE"):
        return os.path.abspath(os.path.expanduser(chosen))
    base = environment.get("XDG_CACHE_HOME") or "~/.cache"
    return os.path.join(os.path.abspath(os.path.expanduser(base)), "fusesoc_firm")


def texts_folder(environment: Mapping[str, str]) -> str:
    """Return the folder of texts of installed packages that earlier processes kept."""
    return os.path.join(default_root(environment), "definitions")
