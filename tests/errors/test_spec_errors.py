"""Bad specifications and what a user is told: NAME.yaml and, word for word, NAME.expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.diagnostics import Diagnostics, InputError
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import RosVersion
from fusesoc_firm.system.analysis import derive
from fusesoc_firm.system.specification import read_specification
from tests.expected import check_expected

FOLDER = Path(__file__).parent / "spec"
SPECIFICATIONS = sorted(FOLDER.glob("*.yaml"))


@pytest.fixture(scope="module")
def libraries() -> dict[RosVersion, MessageLibrary]:
    return {ros: MessageLibrary(ros) for ros in RosVersion}


@pytest.mark.parametrize("path", SPECIFICATIONS, ids=lambda path: path.stem)
def test_a_bad_specification_is_explained(path: Path, libraries: dict[RosVersion, MessageLibrary]) -> None:
    faults = Diagnostics()
    with pytest.raises(InputError) as raised:
        derive(read_specification(path, path.name, faults), path.parent, libraries, faults)
    check_expected(path.with_suffix(".expected"), f"{raised.value}\n")


def test_every_expected_file_has_its_specification() -> None:
    assert {path.stem for path in FOLDER.glob("*.expected")} == {path.stem for path in SPECIFICATIONS}
