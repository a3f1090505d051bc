"""Bad configuration files and their messages: NAME.yaml and, word for word, NAME.expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.converter.order import order_of_config
from fusesoc_firm.message.library import libraries
from fusesoc_firm.text.diagnostics import InputError
from tests.expected import check_expected

FOLDER = Path(__file__).parent / "config"
CONFIGURATIONS = sorted(FOLDER.glob("*.yaml"))


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda path: path.stem)
def test_a_bad_configuration_is_explained(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)  # so that the messages show relative paths
    known = libraries([Path("demo_msgs")], None, None)
    with pytest.raises(InputError) as raised:
        order_of_config(Path(path.name), known)
    check_expected(path.with_suffix(".expected"), f"{raised.value}\n")


def test_every_expected_file_has_its_configuration() -> None:
    assert {path.stem for path in FOLDER.glob("*.expected")} == {path.stem for path in CONFIGURATIONS}
