"""`fusesoc_firm.codec` against rosbags, its arrays, its errors, and the examples in its docstrings."""

from __future__ import annotations

import doctest
import math
import random
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores
from rosbags.typesys.base import normalize_fieldname

import fusesoc_firm
from fusesoc_firm import Codec, CodecError, InputError, codec
from fusesoc_firm.api import codec as module
from fusesoc_firm.frame.codec import used_bytes
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import KINDS, Stimuli
from tests.frame.oracle import Oracle
from tests.seeds import seeded
from tests.typestores import typestore

SEED = seeded(20260715)
STORES = {1: Stores.ROS1_NOETIC, 2: Stores.ROS2_JAZZY}
NAMES = [
    "geometry_msgs/PoseWithCovarianceStamped",
    "nav_msgs/OccupancyGrid",
    "nav_msgs/Path",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/Image",
    "sensor_msgs/Imu",
    "sensor_msgs/JointState",
    "sensor_msgs/LaserScan",
    "sensor_msgs/PointCloud2",
    "shape_msgs/Mesh",
    "std_msgs/Bool",
    "std_msgs/Empty",
    "std_msgs/Float64MultiArray",
    "trajectory_msgs/JointTrajectory",
]


def check_same(found: Any, reference: Any, where: str) -> None:
    """Compare a value with the one that rosbags has read, which has an array for numbers, too."""
    if isinstance(reference, np.ndarray):
        assert isinstance(found, np.ndarray), where
        assert (found.dtype, found.tobytes()) == (reference.dtype, reference.tobytes()), where
    elif isinstance(reference, list):
        assert len(found) == len(reference), where
        for number, pair in enumerate(zip(found, reference, strict=True)):
            check_same(*pair, f"{where}[{number}]")
    elif isinstance(found, dict):
        is_time = found.keys() == {"sec", "nsec"}
        for name, value in found.items():
            attribute = "nanosec" if is_time and name == "nsec" else normalize_fieldname(name)
            other = getattr(reference, attribute)
            # rosbags gives the times of ROS 1 the types of ROS 2.
            check_same(value % 2**32 if is_time else value, other % 2**32 if is_time else other, f"{where}.{name}")
    else:
        assert type(found) is type(reference), where
        assert found == reference or (math.isnan(found) and math.isnan(reference)), where


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_rosbags_reads_and_writes_the_same_bytes(name: str, ros: int) -> None:
    chance = random.Random(f"{SEED} {name} {ros}")
    oracle, store = Oracle(middleware_of(ros)), typestore(STORES[ros])
    long_name = name.replace("/", "/msg/")
    stimuli = Stimuli(oracle.closure(name), middleware_of(ros), chance)
    ours = codec(name, ros)
    for kind in KINDS:
        value = stimuli.message(parse_name(name), kind)
        payload = oracle.serialise(name, value)
        used = used_bytes(oracle.frame(name), payload)
        masked = bytes(byte if use else 0 for byte, use in zip(payload, used, strict=True))
        message = ours.decode(payload)
        read = store.deserialize_ros1 if ros == 1 else store.deserialize_cdr
        check_same(message, read(payload, long_name), name)
        assert ours.encode(value) == ours.encode(message) == masked


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_an_empty_message_has_the_defaults(name: str, ros: int) -> None:
    ours = codec(name, ros)
    new = ours.new()
    assert ours.encode({}) == ours.encode(new)
    read = typestore(STORES[ros]).deserialize_ros1 if ros == 1 else typestore(STORES[ros]).deserialize_cdr
    check_same(new, read(ours.encode({}), name.replace("/", "/msg/")), name)


def test_defaults_of_the_definition_apply(tmp_path: Path) -> None:
    ours = own(tmp_path, "uint8 speed 7\nfloat32[2] gains [1.0, 2.0]\nstring name\n")
    message = ours.decode(ours.encode({"name": "a"}))
    assert (message["speed"], message["gains"].tolist(), message["name"]) == (7, [1.0, 2.0], "a")


def own(folder: Path, text: str, ros: int = 2) -> Codec:
    (folder / "own_msgs" / "msg").mkdir(parents=True)
    (folder / "own_msgs" / "msg" / "Mine.msg").write_text(text)
    return codec("own_msgs/Mine", ros, [folder])


def test_arrays_of_any_type_are_accepted(tmp_path: Path) -> None:
    ours = own(tmp_path, "float32[] gains\nuint8[] data\nint16[2] pair\nbool[] flags\nstring[] names\n")
    lists = {"gains": [1.5, 2.0], "data": [1, 255], "pair": [-1, 2], "flags": [True, False], "names": ["a", "bc"]}
    expected = ours.encode(lists)
    types = {"gains": "<f4", "data": "u1", "pair": "<i2", "flags": "?", "names": "U2"}
    others = {"gains": ">f8", "data": "<i8", "pair": ">i4", "flags": "?", "names": "O"}
    for chosen in (types, others):
        assert ours.encode({name: np.array(lists[name], chosen[name]) for name in lists}) == expected
    assert ours.encode({**lists, "data": b"\x01\xff", "gains": np.array([0, 1.5, 0, 2.0], "f4")[1::2]}) == expected


def test_the_bits_of_a_signalling_nan_are_kept(tmp_path: Path) -> None:
    ours = own(tmp_path, "float32[1] number\n")
    payload = b"\0\1\0\0" + (0x7F800001).to_bytes(4, "little")
    assert ours.encode(ours.decode(payload)) == payload


def test_arrays_are_views_of_the_payload() -> None:
    scan = codec("sensor_msgs/LaserScan")
    payload = scan.encode({"ranges": [1.0, 3.0]})
    with pytest.raises(ValueError, match="read-only"):
        scan.decode(payload)["ranges"][0] = 2.0
    own_bytes = bytearray(payload)
    scan.decode(own_bytes)["ranges"][0] = 2.0
    assert scan.decode(own_bytes)["ranges"].tolist() == [2.0, 3.0]
    assert scan.decode(memoryview(payload))["ranges"].tolist() == [1.0, 3.0]


def test_a_new_message_can_be_changed() -> None:
    imu = codec("sensor_msgs/Imu")
    message = imu.new()
    message["orientation_covariance"][0] = 2.0
    assert imu.decode(imu.encode(message))["orientation_covariance"][0] == 2.0


def test_the_layout_has_offsets_and_sizes_in_bytes() -> None:
    fixed, variable = codec("geometry_msgs/PoseWithCovariance", 1).layout, codec("sensor_msgs/Imu").layout
    assert fixed["pose.orientation.w"] == ("float64", 48, 8)
    assert fixed["covariance"] == ("float64[36]", 56, 288)
    assert variable["header.stamp.nanosec"] == ("uint32", 8, 4)
    assert variable["header.frame_id"] == ("string", None, None)
    assert variable["angular_velocity"] == ("geometry_msgs/Vector3", None, 24)


def test_hashes_are_those_of_rosbags() -> None:
    for name in NAMES:
        assert codec(name, 1).hash == typestore(STORES[1]).generate_msgdef(name.replace("/", "/msg/"))[1]
    assert codec("std_msgs/Bool").hash == f"RIHS01_{typestore(STORES[2]).hash_rihs01('std_msgs/msg/Bool')[7:]}"


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ({"orientation_covariance": np.eye(3)}, "'orientation_covariance' must be a list of 9"),
        ({"orientation_covariance": [0] * 8}, "'orientation_covariance' must be a list of 9"),
        ({"orientation_covariance": np.array(["a"] * 9)}, "'orientation_covariance' must be of type float64"),
        ({"orientation_covariance": 1.0}, "'orientation_covariance' must be a list of 9"),
        ({"orientation": 5}, "the message with the field 'x' must be a mapping of fields, not 5"),
        ({"orientation": [0, 0, 0, 1]}, "the message with the field 'x' must be a mapping of fields, not [0, 0, 0, 1]"),
        ({"header": {"frame_id": b"imu"}}, "'header.frame_id' must be of type string"),
        ({"orientation": {"v": 1}}, "has no field 'orientation.v'"),
        ({"header": {"stamp": {"sec": 2**31}}}, "'header.stamp.sec' must be of type int32"),
        ({"header": {"stamp": {"sec": np.float32(1)}}}, "'header.stamp.sec' must be of type int32"),
    ],
)
def test_a_value_that_does_not_fit_is_refused(message: dict[str, Any], fault: str) -> None:
    with pytest.raises(CodecError, match=re.escape(fault)):
        codec("sensor_msgs/Imu").encode(message)


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (("sensor_msgs/Imo",), "did you mean 'sensor_msgs/Imu'"),
        (("Imu",), "'Imu' is not a message name"),
        (("sensor_msgs/Imu", 3), "unknown ROS version 3"),
        (("sensor_msgs/Imu", 2, ["missing"]), "'missing' is neither a folder nor a bag"),
        (("sensor_msgs/Imu", 2, (), "jazzi"), "unknown ROS distribution 'jazzi'"),
    ],
)
def test_an_unknown_message_or_source_is_reported(arguments: tuple[Any, ...], fault: str) -> None:
    with pytest.raises(InputError) as caught:
        codec(*arguments)
    assert fault in str(caught.value)


def test_the_examples_in_the_docstrings_are_right() -> None:
    result = doctest.testmod(module)
    assert (result.attempted > 3, result.failed) == (True, 0)


def test_names_are_listed_and_others_refused() -> None:
    assert {"codec", "System", "__version__"} <= {*dir(fusesoc_firm)}
    assert all(getattr(fusesoc_firm, name) for name in fusesoc_firm.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'codecs'"):
        fusesoc_firm.codecs  # noqa: B018


def test_the_package_imports_nothing_before_it_is_used() -> None:
    code = "import sys; before = {*sys.modules}; import fusesoc_firm; print({*sys.modules} - before)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "{'fusesoc_firm'}\n"
