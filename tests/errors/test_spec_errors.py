"""Bad specifications and their messages: NAME.yaml and, word for word, NAME.expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.diagnostics import InputError
from tests.expected import check_expected

FOLDER = Path(__file__).parent / "spec"
SPECIFICATIONS = sorted(FOLDER.glob("*.yaml"))


def derive_file(
    path: Path, libraries: dict[Middleware, MessageLibrary], monkeypatch: pytest.MonkeyPatch
) -> DerivedSystem:
    """The system of one of `SPECIFICATIONS`, as `firm check` derives it."""
    monkeypatch.chdir(FOLDER)  # so that the messages show relative paths
    return load_system(Path(path.name), libraries).system


@pytest.mark.parametrize("path", SPECIFICATIONS, ids=lambda path: path.stem)
def test_a_bad_specification_is_explained(
    path: Path, libraries: dict[Middleware, MessageLibrary], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError) as raised:
        derive_file(path, libraries, monkeypatch)
    check_expected(path.with_suffix(".expected"), f"{raised.value}\n")


def test_every_expected_file_has_its_specification() -> None:
    assert {path.stem for path in FOLDER.glob("*.expected")} == {path.stem for path in SPECIFICATIONS}
