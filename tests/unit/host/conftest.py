"""What several tests of this folder compile once, and the rule that none of them may leave a file or socket open."""

from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.unit.host.drivers import Driver, compile_driver

_OPEN = ("error::ResourceWarning", "error::pytest.PytestUnraisableExceptionWarning")


def pytest_collection_modifyitems(items: Iterable[pytest.Item]) -> None:
    """What is collected as garbage while it is open is a fault of the test that runs."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            for rule in _OPEN:
                item.add_marker(pytest.mark.filterwarnings(rule))


@pytest.fixture(scope="session")
def node_driver(tmp_path_factory: pytest.TempPathFactory) -> Driver:
    """The node's engine in C++, with sanitizers."""
    return compile_driver("node", tmp_path_factory.mktemp("node"))
