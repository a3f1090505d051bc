"""What several tests of this folder compile once."""

import pytest

from tests.node.drivers import Driver, compile_driver


@pytest.fixture(scope="session")
def node_driver(tmp_path_factory: pytest.TempPathFactory) -> Driver:
    """The node's engine in C++, with sanitizers."""
    return compile_driver("node", tmp_path_factory.mktemp("node"))
