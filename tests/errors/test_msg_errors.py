"""Every bad `.msg` file with its exact message: `<name>.msg` and `<name>.expected`, a folder for each version."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.diagnostics import InputError
from tests.expected import check_expected

HERE = Path(__file__).parent / "msg"
FILES = sorted(HERE.glob("ros[12]/*.msg"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_message_error(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(HERE)  # so that the messages show relative paths
    folder = path.parent.name
    library = MessageLibrary(middleware_of(int(folder[-1])), [Path(folder)])
    with pytest.raises(InputError) as caught:
        library.closure(MessageName(folder, path.stem))
    check_expected(path.with_suffix(".expected"), f"{caught.value}\n")


def test_every_expected_message_has_its_file() -> None:
    assert {path.stem for path in HERE.glob("ros[12]/*.expected")} == {path.stem for path in FILES}
