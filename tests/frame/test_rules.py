"""The rules of the two serialisations as tables: what a layout takes from them must be complete and consistent."""

from __future__ import annotations

import struct

import pytest

from fusesoc_firm.frame.position import Position
from fusesoc_firm.message.dialect import dialect_of
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import RosVersion


@pytest.mark.parametrize("ros", RosVersion)
def test_every_primitive_of_the_version_has_a_wire_type(ros: RosVersion) -> None:
    rules = middleware_of(ros).rules
    assert rules.scalars.keys() | rules.compounds.keys() == dialect_of(ros).primitives
    assert not rules.scalars.keys() & rules.compounds.keys()


@pytest.mark.parametrize("ros", RosVersion)
def test_sizes_are_those_of_the_codes(ros: RosVersion) -> None:
    for name, kind in middleware_of(ros).rules.scalars.items():
        assert struct.calcsize(f"<{kind.code}") == kind.size, name
        assert kind.bits == (1 if kind.name == "bool" else 8 * kind.size)


@pytest.mark.parametrize(
    ("offset", "size", "aligned"), [(0, 8, 0), (1, 8, 8), (8, 8, 8), (9, 4, 12), (3, 2, 4), (5, 1, 5)]
)
def test_alignment(offset: int, size: int, aligned: int) -> None:
    position = Position(middleware_of(RosVersion.ROS2).rules.max_alignment, frozenset({offset % 8}))
    assert position.padding(min(size, middleware_of(RosVersion.ROS2).rules.max_alignment)) == aligned - offset
    assert middleware_of(RosVersion.ROS1).rules.max_alignment == 1
