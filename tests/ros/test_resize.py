"""The replica of RobotPerf's a5 as a node of ROS 2: the processor's node and the simulated hardware, the same bytes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ros.cpp_nodes import NodeProcess, missing_ros, running_ros
from tests.ros.live_nodes import LiveNode, specification
from tests.ros.resizing import CPU_NODE, resized
from tests.seeds import seeded

SEED = seeded(20261126)

pytestmark = [
    pytest.mark.check,
    pytest.mark.skipif(bool(missing_ros(2)), reason=missing_ros(2) or ""),
]


@pytest.mark.parametrize("is_hardware", [False, True])
def test_both_nodes_give_the_same_bytes(tmp_path: Path, is_hardware: bool) -> None:
    with running_ros(2, tmp_path) as ros:
        log = tmp_path / "node.log"
        if is_hardware:
            spec = specification("resize", 2, tmp_path)
            node: NodeProcess = LiveNode(ros, log, ["live", str(spec), "--build-root", str(tmp_path / "build")])
        else:
            node = NodeProcess(log, [ros.python, str(CPU_NODE)], dict(ros.environment))
        with node:
            _, largest_difference = resized(ros, tmp_path, (6, 9), 5, SEED)
            assert largest_difference == 0
            assert node.stop() == 0, node.said()
