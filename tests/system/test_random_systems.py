"""Random specifications: the derived system has the blocks and connections that they mean, and no fault is found."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.message.model import MessageName
from fusesoc_firm.system.system_core import load_system
from tests.random_systems import random_system
from tests.seeds import seeded
from tests.system.systems import LIBRARIES

SEED = seeded(20241122)
LARGEST = 60


@pytest.mark.parametrize("number", range(20))
def test_a_random_system_is_what_it_says(number: int, tmp_path: Path) -> None:
    print(f"seed {SEED + number}")
    chance = random.Random(SEED + number)
    blocks = chance.randint(2, LARGEST)
    random_one = random_system(chance, blocks, chance.randint(1, blocks // 2))
    path = tmp_path / "spec.yaml"
    path.write_text(random_one.text, encoding="utf-8")
    written = yaml.safe_load(random_one.text)["blocks"]
    system = load_system(path, LIBRARIES, needs_sources=False).system
    connections = {
        (item.source.block, item.frame.message): {end.block for end in item.sinks} for item in system.connections
    }
    assert len(written) == blocks
    assert connections == {source: set(sinks) for source, sinks in random_one.sinks.items()}
    of_mode = {
        mode: [block["name"] for block in written if block.get("mode") == mode] for mode in ("subscriber", "publisher")
    }
    assert [item.block for item in system.subscribers] == of_mode["subscriber"]
    assert [item.block for item in system.publishers] == of_mode["publisher"]
    assert [item.block for item in system.accelerators] == [block["name"] for block in written if "type" in block]


def test_all_that_random_systems_may_have_occurs() -> None:
    """Forks, publishers of parts, inputs and outputs of parts, several inputs, types of several blocks, both ROS."""
    seen = set()
    for number in range(40):
        random_one = random_system(random.Random(SEED + number), 30, 15)
        content = yaml.safe_load(random_one.text)
        types = [block["type"] for block in content["blocks"] if "type" in block]
        sides = [
            item for kind in content.get("accelerators", []) for side in kind["interface"].values() for item in side
        ]
        ways = [way for block in content["blocks"] for way in block.get("outgoing", [])]
        seen |= {"fork"} if any(len(sinks) > 2 for sinks in random_one.sinks.values()) else set()
        seen |= {"several blocks"} if len(set(types)) < len(types) else set()
        seen |= {"part of an interface"} if any("include" in item for item in sides) else set()
        seen |= {key for way in ways for key in way} | {key for block in content["blocks"] for key in block}
        seen |= {item["middleware"] for item in sides}
        seen |= {f"{len(kind['interface']['input'])} inputs" for kind in content.get("accelerators", [])}
    expected = {
        "fork",
        "several blocks",
        "part of an interface",
        "include",
        "exclude",
        "buffer",
        "1 inputs",
        "2 inputs",
    }
    assert expected | {"ROS1", "ROS2"} <= seen


def test_as_many_messages_as_asked_for_if_there_is_room() -> None:
    random_one = random_system(random.Random(SEED), 60, 40)
    assert len(yaml.safe_load(random_one.text)["blocks"]) == 60
    messages: set[MessageName] = {message for _, message in random_one.sinks}
    assert len(messages) == 40
