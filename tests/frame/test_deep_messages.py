"""Random messages of many levels: our layout and lengths against rosbags' bytes, with each computed once."""

from __future__ import annotations

import random

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.length import length_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify import rosbags_judge
from fusesoc_firm.runs.verify.stimuli import KINDS, Stimuli
from tests.frame.oracle import parsed
from tests.frame.random_messages import PACKAGE, deep_texts

DRAWN = 25


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_bytes_and_lengths_of_deep_messages_are_those_of_rosbags(ros: Middleware) -> None:
    for seed in range(DRAWN):
        chance = random.Random(seed)
        levels = chance.randint(3, 10)
        definitions = parsed(deep_texts(ros, chance, levels), ros)
        name = parse_name(f"{PACKAGE}/L{levels - 1}")
        frame = frame_of(name, definitions)
        length = length_of(frame)
        drawn = [Stimuli(definitions, ros, chance).message(name, kind) for kind in KINDS]
        for value, payload in zip(drawn, rosbags_judge.serialise(name, definitions, drawn), strict=True):
            assert encode(frame, value) == payload, f"seed {seed}"
            assert length.of(value) == len(payload), f"seed {seed}"
            assert length.minimum <= len(payload) <= (length.maximum or len(payload)), f"seed {seed}"
