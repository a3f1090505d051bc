"""The notes of plans and setups contain what FuseSoC reads of this package's libraries, and nothing else of them."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.builds.setup.recall import observed
from fusesoc_firm.tools.library_path import library_root
from fusesoc_firm.tools.own_code import PACKAGE


def test_a_note_contains_what_was_read_of_our_libraries(tmp_path: Path) -> None:
    core = next((library_root() / "cores" / "axis").glob("*.core"))
    with observed() as found:
        core.read_bytes()
        [*core.parent.iterdir()]
        # Our own code is part of every note.
        (PACKAGE / "builds" / "setup" / "recall.py").read_bytes()
    facts = found.facts(tmp_path)
    assert [fact[:2] for fact in facts] == [("file", str(core)), ("folder", str(core.parent))]
    assert found.is_whole


def test_byte_code_beside_modules_does_not_change_a_folder(tmp_path: Path) -> None:
    def listed() -> list[tuple[str, str, str | None]]:
        with observed() as found:
            [*tmp_path.iterdir()]
        return found.facts(tmp_path / "build")

    (tmp_path / "generator.py").touch()
    before = listed()
    (tmp_path / "__pycache__").mkdir()
    assert listed() == before
    (tmp_path / "other.py").touch()
    assert listed() != before
