"""Files that hold what a test expects: generated text, or what a user is told, word for word.

After a wanted change, `UPDATE_EXPECTED=1 python -m pytest ...` writes them anew; read the difference before a commit.
"""

from __future__ import annotations

import os
from pathlib import Path


def check_expected(file: Path, text: str) -> None:
    """Compare `text` with a file, or write the file where UPDATE_EXPECTED is set."""
    if os.environ.get("UPDATE_EXPECTED"):
        file.write_text(text, encoding="utf-8")
    assert file.is_file(), f"no {file}; UPDATE_EXPECTED=1 makes it"
    assert text == file.read_text(encoding="utf-8"), f"not {file}; UPDATE_EXPECTED=1 accepts the change"
