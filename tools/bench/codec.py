"""The time of our codec beside those of rosbags and, if it is installed, mcap-ros2-support-fast."""

from __future__ import annotations

import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import metadata
from itertools import pairwise
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm import codec
from tools.bench.tables import MET, MISSED, Table, Tell

TITLE = "Encoding and decoding in Python"
READY_TITLE = "A codec in a new process"
ENCODE, DECODE = "encode", "decode"
FAST = "mcap-ros2-support-fast"
ROUNDS, RUNS = 5, 200
TO_ROSBAGS, TO_FAST, READY_MS = 1.0, 2.0, 5.0
_STORES = {1: Stores.ROS1_NOETIC, 2: Stores.ROS2_JAZZY}
_COLUMNS = (
    *("message", "ROS", "operation", "us", "rosbags, us", "to rosbags", "bar", f"{FAST}, us", "to it", "its bar"),
    "result",
)
_NOTE = f"""
    PointCloud2 has 1 MB of data, and DiagnosticArray 10 elements with 10 pairs of texts each. Each codec encodes the
    message that it decodes; {FAST} also encodes ours. Arrays are NumPy arrays. Times are the medians of {ROUNDS}
    rounds, in each of which every codec runs {RUNS} times in turn and its median counts. Each codec has encoded and
    decoded the same bytes before.
    """
_READY_COLUMNS = ("message", "ROS", "definition, ms", "first encode, ms", "first decode, ms", "in all, ms", "bar, ms")
_READY_NOTE = f"""
    The processor time in a new process after the import, up to the first message encoded and decoded: reading the
    definitions, computing the layout, generating and compiling both functions. Medians of {ROUNDS} processes. The
    definitions of the distribution are in the folder of cached results; the first process of a user also loads the
    tables of rosbags, which takes the time in the row 'without kept definitions'.
    """
_WITHOUT = "without kept definitions"
_FIRST_USE = """
import json, sys, time
from fusesoc_firm import codec
times = [time.process_time()]
made = codec(sys.argv[1], ros=int(sys.argv[2]))
times.append(time.process_time())
payload = made.encode({})
times.append(time.process_time())
made.decode(payload)
times.append(time.process_time())
print(json.dumps(times))
"""


def imu() -> dict[str, Any]:
    """A message of sensor_msgs/Imu."""
    message: dict[str, Any] = {"header": {"frame_id": "imu_link"}}
    for number, name in enumerate(("orientation", "angular_velocity", "linear_acceleration")):
        axes = "xyzw" if name == "orientation" else "xyz"
        message[name] = {axis: number + place / 7 for place, axis in enumerate(axes)}
        message[f"{name}_covariance"] = np.arange(9.0)
    return message


def point_cloud() -> dict[str, Any]:
    """A message of sensor_msgs/PointCloud2 with 65,536 points of 16 bytes."""
    fields = [
        {"name": name, "offset": 4 * place, "datatype": 7, "count": 1}
        for place, name in enumerate(("x", "y", "z", "intensity"))
    ]
    data = np.arange(2**20, dtype=np.uint8)
    sizes = {"height": 1, "width": 2**16, "point_step": 16, "row_step": 2**20}
    return {"header": {"frame_id": "lidar"}, "fields": fields, "data": data, **sizes}


def diagnostics() -> dict[str, Any]:
    """A message of diagnostic_msgs/DiagnosticArray with 10 elements of 10 pairs."""

    def status(number: int) -> dict[str, Any]:
        values = [{"key": f"key {place}", "value": str(place * 1.5)} for place in range(10)]
        return {"name": f"motor {number}", "message": "fine", "hardware_id": f"m{number}", "values": values}

    return {"status": [status(number) for number in range(10)]}


CASES = {
    "sensor_msgs/Imu": imu,
    "sensor_msgs/PointCloud2": point_cloud,
    "diagnostic_msgs/DiagnosticArray": diagnostics,
}


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    each = [(name, ros) for name in CASES for ros in ("2", "1")]
    times: list[tuple[str, ...]] = [(*case, operation) for case in each for operation in (ENCODE, DECODE)]
    return {TITLE: times, READY_TITLE: [*each, (_WITHOUT, "2")]}


def measure(tell: Tell) -> list[Table]:
    """Measure all codecs in turn; `tell` is called with each row."""
    return [
        Table(TITLE, _COLUMNS, tuple(_told(_rows(), tell)), _NOTE),
        Table(READY_TITLE, (*_READY_COLUMNS, "result"), tuple(_told(_ready_rows(), tell)), _READY_NOTE),
    ]


def versions() -> list[str]:
    """The versions of the other codecs."""
    others = ["rosbags", *([FAST] if _has_fast() else [])]
    return [f"{name} {metadata.version(name)}" for name in others]


def _told(rows: Iterator[tuple[str, ...]], tell: Tell) -> Iterator[tuple[str, ...]]:
    for row in rows:
        tell(" ".join(row))
        yield row


def _has_fast() -> bool:
    return importlib.util.find_spec("mcap_ros2_support_fast") is not None


# --- encoding and decoding -----------------------------------------------------------------------------------------


def _rows() -> Iterator[tuple[str, ...]]:
    for name, value in CASES.items():
        for ros in (2, 1):
            encoders, decoders = _functions(name, ros, value())
            for operation, functions in ((ENCODE, encoders), (DECODE, decoders)):
                yield (name, str(ros), operation, *_compared(functions))


def _functions(
    name: str, ros: int, value: dict[str, Any]
) -> tuple[list[Callable[[], object]], list[Callable[[], object]]]:
    """Return the functions that encode and decode a message, ours first, of codecs that agree on its bytes."""
    ours, store, long_name = codec(name, ros), get_typestore(_STORES[ros]), name.replace("/", "/msg/")
    payload = ours.encode(value)
    read, write = (
        (store.deserialize_ros1, store.serialize_ros1) if ros == 1 else (store.deserialize_cdr, store.serialize_cdr)
    )
    message, other = ours.decode(payload), read(payload, long_name)
    assert bytes(write(other, long_name)) == ours.encode(message) == payload, name
    encoders: list[Callable[[], object]] = [lambda: ours.encode(message), lambda: write(other, long_name)]
    decoders: list[Callable[[], object]] = [lambda: ours.decode(payload), lambda: read(payload, long_name)]
    if ros == 2 and _has_fast():
        # It is for measurements only, and not in the environment of the checks.
        factory = importlib.import_module("mcap_ros2_support_fast")
        text, _ = store.generate_msgdef(long_name, ros_version=2)
        schema = _Schema(long_name, text.encode())
        fast_write = factory.ROS2EncoderFactory().encoder_for(schema)
        fast_read = factory.DecoderFactory().decoder_for("cdr", schema)
        assert bytes(fast_write(message)) == payload, name
        encoders.append(lambda: fast_write(message))
        decoders.append(lambda: fast_read(payload))
    return encoders, decoders


class _Schema:
    """A definition as mcap-ros2-support-fast takes it."""

    id = 1
    encoding = "ros2msg"

    def __init__(self, name: str, data: bytes) -> None:
        self.name = name
        self.data = data


def _compared(functions: list[Callable[[], object]]) -> tuple[str, ...]:
    """Return the cells of a row from the time of each function, ours first."""
    rounds = [[_microseconds(function) for function in functions] for _ in range(ROUNDS)]
    ours, *others = (statistics.median(times) for times in zip(*rounds, strict=True))
    cells, is_met = [f"{ours:.1f}"], True
    for bar, other in zip((TO_ROSBAGS, TO_FAST), others, strict=False):
        cells += [f"{other:.1f}", f"{ours / other:.2f}", f"{bar:g}"]
        is_met = is_met and ours / other <= bar
    return (*cells, *[""] * (3 * (2 - len(others))), MET if is_met else MISSED)


def _microseconds(function: Callable[[], object]) -> float:
    times = []
    for _ in range(RUNS):
        start = time.perf_counter_ns()
        function()
        times.append(time.perf_counter_ns() - start)
    return statistics.median(times) / 1000


# --- the first message ---------------------------------------------------------------------------------------------


def _ready_rows() -> Iterator[tuple[str, ...]]:
    with tempfile.TemporaryDirectory() as folder:
        for name in CASES:
            for ros in (2, 1):
                _first_use(name, ros, folder)
                times = [_first_use(name, ros, folder) for _ in range(ROUNDS)]
                yield (name, str(ros), *_ready_cells(times))
    times = []
    for _ in range(ROUNDS):
        with tempfile.TemporaryDirectory() as empty:
            times.append(_first_use("sensor_msgs/Imu", 2, empty))
    *cells, _, _ = _ready_cells(times)
    yield (_WITHOUT, "2", *cells, "", "")


def _first_use(name: str, ros: int, folder: str) -> list[float]:
    """Return the milliseconds of the definition, of the first encode and of the first decode in a new process."""
    environment = os.environ | {"FUSESOC_FIRM_CACHE": folder}
    command = [sys.executable, "-c", _FIRST_USE, name, str(ros)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    moments = json.loads(done.stdout)
    return [1000 * (after - before) for before, after in pairwise(moments)]


def _ready_cells(times: list[list[float]]) -> tuple[str, ...]:
    parts = [statistics.median(part) for part in zip(*times, strict=True)]
    in_all = statistics.median(map(sum, times))
    result = MET if in_all <= READY_MS else MISSED
    return (*(f"{part:.1f}" for part in (*parts, in_all)), f"{READY_MS:g}", result)
