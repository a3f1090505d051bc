"""What several tests of this folder compile once."""

import pytest

from tests.node.drivers import Driver, cpp_driver


@pytest.fixture(scope="session")
def node_driver() -> Driver:
    """The node's engine in C++, with sanitizers."""
    return cpp_driver("node")
