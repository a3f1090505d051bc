"""The source of the site: README.md, docs, and every file in the repository that they link to, at its place.

`python -m tools.pages.stage` copies it to build/pages for `make docs`.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from tests.hdl.ghdl import REPOSITORY
from tools.pages.page import Page, pages


def stage(folder: Path) -> None:
    """Copy what the site consists of, so that a link leads to the same file on a forge and on the site."""
    shutil.rmtree(folder, ignore_errors=True)
    waiting = [page.file for page in pages()]
    seen = set(waiting)
    while waiting:
        file = waiting.pop()
        copy = folder / file.relative_to(REPOSITORY)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, copy)
        linked = {link.file for link in Page(file).links} if file.suffix == ".md" else set()
        waiting += [path for path in linked - seen if path.is_file()]
        seen |= linked


if __name__ == "__main__":
    stage(REPOSITORY / "build" / "pages")
