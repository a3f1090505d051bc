"""Files in C, C++ and VHDL have the constants of Python."""

from __future__ import annotations

from tools.constants import files


def test_the_constants_are_those_of_python() -> None:
    """`make constants` puts it right."""
    for path, text in files().items():
        assert path.read_text(encoding="ascii") == text, path
