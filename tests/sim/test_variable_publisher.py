"""Publishers of messages of variable size in simulation."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.message.model import RosVersion
from tests.sim.publishers import PublisherBench

SEED = 20240607
ROS1, ROS2 = RosVersion


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> PublisherBench:
    return PublisherBench(tmp_path_factory.mktemp("publishers"))


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("ros", RosVersion)
@pytest.mark.parametrize("name", ["sensor_msgs/Image"])
def test_first(bench: PublisherBench, tmp_path: Path, ros: RosVersion, name: str, width: int) -> None:
    publisher = bench.publisher(ros, name, width)
    messages = [publisher.good(value) for value in publisher.values(8, random.Random(SEED))]
    publisher.run(tmp_path, messages, SEED=SEED)
