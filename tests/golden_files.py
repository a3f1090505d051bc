"""Golden files: texts in tests/golden that generated ones must equal."""

from __future__ import annotations

import os
from pathlib import Path

GOLDEN = Path(__file__).parent / "golden"


def check_golden(name: str, text: str) -> None:
    """Compare `text` with the golden file, or make it the golden file where FIRM_UPDATE_GOLDEN is set."""
    golden = GOLDEN / name
    if os.environ.get("FIRM_UPDATE_GOLDEN"):
        golden.write_text(text, encoding="utf-8")
    assert golden.is_file(), f"no {golden}; FIRM_UPDATE_GOLDEN=1 makes it"
    assert text == golden.read_text(encoding="utf-8"), f"not {golden}; FIRM_UPDATE_GOLDEN=1 accepts the change"
