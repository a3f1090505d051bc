"""What the tests of this folder share."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import RosVersion

SPEC_FOLDER = Path(__file__).parent / "spec"


def make_libraries() -> dict[RosVersion, MessageLibrary]:
    """The messages that the bad specifications of `spec` can name, those in `spec/messages` among them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(SPEC_FOLDER)  # so that messages show relative paths
        return {ros: MessageLibrary(ros, [Path("messages")]) for ros in RosVersion}


@pytest.fixture(scope="session")
def libraries() -> dict[RosVersion, MessageLibrary]:
    return make_libraries()
