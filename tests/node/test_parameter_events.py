"""Events about parameters of the node in C++ for ROS 2, as the independent CDR of rosbags reads them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.node.drivers import cpp_driver

STORE = get_typestore(Stores.ROS2_JAZZY)
REQUEST = "test_msgs/msg/SetParameters"
STORE.register(get_types_from_msg("rcl_interfaces/Parameter[] parameters", REQUEST))
# The fields of rcl_interfaces/msg/ParameterValue, by the numbers of ParameterType.
FIELDS = {1: "bool_value", 2: "integer_value", 3: "double_value"}
TYPES = {bool: 1, int: 2, float: 3}


def request(**values: Any) -> str:
    """A client's request to set parameters of the block."""
    types = STORE.types
    found = []
    for name, value in values.items():
        type_ = type(value)
        numbers = (value if type_ is kind else kind(0) for kind in TYPES)
        empty = (np.zeros(0, kind) for kind in ("uint8", "bool", "int64", "float64"))
        made = types["rcl_interfaces/msg/ParameterValue"](TYPES[type_], *numbers, "", *empty, [])
        found.append(types["rcl_interfaces/msg/Parameter"](f"block.{name}", made))
    return bytes(STORE.serialize_cdr(types[REQUEST](found), REQUEST)).hex()


def values(items: Any) -> dict[str, Any]:
    return {item.name.removeprefix("block."): getattr(item.value, FIELDS[item.value.type]) for item in items}


def answers(*lines: str) -> list[list[dict[str, Any]]]:
    """The new, changed and deleted parameters of each event; a line about a refused value has none."""
    found: list[list[dict[str, Any]]] = []
    for line in cpp_driver("parameter_events").answers(lines):
        kind, _, rest = line.partition(" ")
        if kind == "event":
            event: Any = STORE.deserialize_cdr(bytes.fromhex(rest), "rcl_interfaces/msg/ParameterEvent")
            assert event.node == "/arm/node"
            assert 0 <= time.time() - event.stamp.sec - event.stamp.nanosec * 1e-9 < 600
            found.append([*map(values, (event.new_parameters, event.changed_parameters, event.deleted_parameters))])
        elif kind != "response":
            assert line == "the parameter block.gain is not set: 101 is outside of the range; legal: -4 to 100"
            found.append([])
    return found


def test_an_event_has_all_parameters_and_one_each_change() -> None:
    found = answers(
        f"set_parameters {request(gain=-4, offset=2.25)}",
        f"set_parameters {request(gain=101)}",
        f"set_parameters_atomically {request(offset=1.5, invert=True)}",
    )
    assert found == [
        [{"gain": 3, "offset": 0.5, "invert": False}, {}, {}],
        [{}, {"gain": -4}, {}],
        [{}, {"offset": 2.25}, {}],
        [],
        [{}, {"offset": 1.5, "invert": True}, {}],
    ]
