"""The rules of the two serialisations as tables, which must be complete and consistent for layouts."""

from __future__ import annotations

import struct

import pytest

from fusesoc_firm.frame.position import Position
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import dialect_of


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_primitive_of_the_version_has_a_wire_type(ros: Middleware) -> None:
    rules = ros.rules
    assert rules.scalars.keys() | rules.compounds.keys() == dialect_of(ros).primitives
    assert not rules.scalars.keys() & rules.compounds.keys()


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_sizes_are_those_of_the_codes(ros: Middleware) -> None:
    for name, kind in ros.rules.scalars.items():
        assert struct.calcsize(f"<{kind.code}") == kind.size, name
        assert kind.bits == (1 if kind.name == "bool" else 8 * kind.size)


@pytest.mark.parametrize(
    ("offset", "size", "aligned"), [(0, 8, 0), (1, 8, 8), (8, 8, 8), (9, 4, 12), (3, 2, 4), (5, 1, 5)]
)
def test_alignment(offset: int, size: int, aligned: int) -> None:
    position = Position(ROS2.rules.max_alignment, frozenset({offset % 8}))
    assert position.padding(min(size, ROS2.rules.max_alignment)) == aligned - offset
    assert ROS1.rules.max_alignment == 1
