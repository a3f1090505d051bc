"""The built page: a part of each wheel. In a checkout, it is built from its sources when they are newer."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

PAGE = Path(__file__).parent / "static"
_SOURCES = Path(__file__).parent / "page"
_HINT = "'make studio' builds it"


def build_page(tell: Callable[[str], None]) -> None:
    """Build the page of a checkout if its sources are newer; tell what is done, or why it cannot be done."""
    if not _is_old():
        return
    # `pip install 'fusesoc-firm[page]'` puts npm beside the interpreter.
    places = [str(Path(sys.executable).parent), os.environ.get("PATH", "")]
    npm = shutil.which("npm", path=os.pathsep.join(places))
    if not npm:
        tell(f"the page of this checkout is {'old' if _is_built() else 'not built'}, and npm is missing: {_HINT}")
        return
    tell("building the page from its sources")
    environment = os.environ | {"PATH": os.pathsep.join(places)}
    steps = [["run", "--silent", "build"]]
    if not (_SOURCES / "node_modules").exists():
        steps.insert(0, ["ci", "--silent", "--no-audit", "--no-fund"])
    for step in steps:
        command = [npm, *step]
        done = subprocess.run(command, cwd=_SOURCES, env=environment, text=True, capture_output=True, check=False)
        if done.returncode:
            tell(f"the page cannot be built: {' '.join(step)} failed; {_HINT}\n{done.stdout}{done.stderr}".rstrip())
            return


def say_if_missing(tell: Callable[[str], None]) -> None:
    """Tell if there is no page to show."""
    if not _is_built():
        tell(f"the page is not built, so the browser shows none: {remedy()}")


def remedy() -> str:
    """Return how a missing page is obtained: by a build in a checkout, or by another wheel."""
    return _HINT if _SOURCES.is_dir() else "install a wheel that was built after 'make studio'"


def _is_built() -> bool:
    return (PAGE / "index.html").is_file()


def _is_old() -> bool:
    """Whether the sources of a checkout are newer than the page; an installation has no sources."""
    if not (_SOURCES / "src").is_dir():
        return False
    sources = [*(_SOURCES / "src").iterdir(), _SOURCES / "package-lock.json"]
    built = (PAGE / "index.html").stat().st_mtime if _is_built() else 0.0
    return any(path.stat().st_mtime > built for path in sources)
