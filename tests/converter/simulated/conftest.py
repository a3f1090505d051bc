"""What the tests of converters in simulation share: the bench of subscribers."""

from __future__ import annotations

import pytest

from tests.converter.simulated.subscribers import SubscriberBench


@pytest.fixture(scope="module")
def subscribers(tmp_path_factory: pytest.TempPathFactory) -> SubscriberBench:
    return SubscriberBench(tmp_path_factory.mktemp("subscribers"))
