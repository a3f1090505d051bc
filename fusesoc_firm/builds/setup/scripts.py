"""The files of a generator's script: modules that it imports from its own folder, and files that it names.

A script in another language than Python is its only file.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_LARGEST = 1 << 20
_LONGEST_NAME = 255


def script_files(script: Path) -> list[Path]:
    """Return a script, the modules that it imports from its own folder, and the files that these name in texts."""
    found = {script: None}
    waiting = [script]
    while waiting:
        path = waiting.pop()
        for other in _named(path, script.parent):
            if other not in found:
                found[other] = None
                waiting += [other] if other.suffix == ".py" else ()
    return [*found]


def _named(path: Path, root: Path) -> Iterator[Path]:
    """Yield the files below `root` that a file in Python imports or names."""
    try:
        text = path.read_bytes() if path.stat().st_size <= _LARGEST else b""
        tree = ast.parse(text)
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _modules(root.joinpath(*alias.name.split(".")))
        elif isinstance(node, ast.ImportFrom):
            folder = path.parents[node.level - 1] if node.level else root
            module = folder.joinpath(*(node.module or "").split("."))
            for place in (module, *(module / alias.name for alias in node.names)):
                yield from _modules(place)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and 0 < len(node.value) <= _LONGEST_NAME:
            # The text may contain characters that paths cannot have.
            with suppress(OSError, ValueError):
                yield from (file for file in {path.parent / node.value, root / node.value} if file.is_file())


def _modules(path: Path) -> Iterator[Path]:
    candidates = (path.with_suffix(".py"), *(folder / "__init__.py" for folder in (path, path.parent)))
    yield from (file for file in candidates if file.is_file())
