"""Fixtures and helpers for the tests in this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware

SPEC_FOLDER = Path(__file__).parent / "spec"


def make_libraries() -> dict[Middleware, MessageLibrary]:
    """The messages that the bad specifications of `spec` can name, including those in `spec/messages`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(SPEC_FOLDER)  # so that messages show relative paths
        return {ros: MessageLibrary(ros, [Path("messages")]) for ros in (ROS1, ROS2)}


@pytest.fixture(scope="session")
def libraries() -> dict[Middleware, MessageLibrary]:
    return make_libraries()
