"""GHDL 2.0 loses constants of 64, 96, ... bits with ones in the highest 32 only: no table of a converter is one."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.converter.steps import digit_rows, is_lossy
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from tests.converter.simulated.subscribers import LENGTH_BYTES, SubscriberBench
from tests.payloads import Payloads
from tests.seeds import seeded

SEED = seeded(20261123)
# 32 steps at 8 and 16 bits: of the 128 entries of a table, those of the last steps are the highest 32.
MESSAGE = "sensor_msgs/JointState"


@pytest.mark.parametrize("width", [8, pytest.param(16, marks=pytest.mark.check)])
def test_the_netlist_takes_trailing_bytes(tmp_path: Path, width: int) -> None:
    """Only the end of a message decides whether such bytes follow."""
    name = parse_name(MESSAGE)
    subscriber = SubscriberBench(tmp_path).subscriber(frame_of(name, MessageLibrary(ROS2).closure(name)), width)
    payload = Payloads(ROS2, MESSAGE).draw(random.Random(SEED))
    frames = [(len(payload) + tail).to_bytes(LENGTH_BYTES, "little") + payload + bytes(tail) for tail in (0, 1, 3, 0)]
    events = subscriber.run(tmp_path, frames)
    assert not [event for event in events if event.startswith("frame_error")]
    subscriber.library.replace_by_netlist(subscriber.entity)
    subscriber.analyse_bench()
    assert subscriber.run(tmp_path, frames) == events


@pytest.mark.parametrize(("entries", "bits"), [(31, 31), (32, 32), (33, 33), (64, 65), (80, 80), (96, 97), (128, 129)])
def test_a_table_has_a_bit_more(entries: int, bits: int) -> None:
    rows = "".join(digit_rows("1" * entries))
    assert len(rows) == bits
    assert is_lossy(entries) == (bits > entries) == rows.startswith("0")


def test_no_row_of_a_table_is_a_constant_that_may_be_lost() -> None:
    """GHDL evaluates each literal of a table on its own."""
    assert not [entries for entries in range(1, 400) for row in digit_rows("1" * entries) if is_lossy(len(row))]
