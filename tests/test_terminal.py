"""The pictures of a terminal and of a waveform in the documentation are those of this version, and show no places."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.terminal import main

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"


@pytest.mark.check
def test_the_pictures_are_those_of_this_version(tmp_path: Path) -> None:
    main(tmp_path)
    for name in ("terminal.svg", "waves.svg"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert text == (PICTURES / name).read_text(encoding="utf-8"), "run: python -m tools.terminal docs/pictures"
        assert "/home" not in text and "/tmp" not in text
