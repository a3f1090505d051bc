"""The replica of RobotPerf's a5, resize: hardware at its clock, and a node of the processor on this machine."""

from __future__ import annotations

import contextlib
import io
import statistics
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys.store import Typestore

from fusesoc_firm.message.library import libraries
from fusesoc_firm.node.transport.built_simulator import CoreSources, build_simulator
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.replay.command import replay
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.diagnostics import InputError
from tests.applications.images import load_model
from tests.ros.cpp_nodes import NodeProcess, missing_ros, running_ros
from tests.ros.live_nodes import LiveNode
from tests.ros.resizing import CPU_NODE, noise, resized
from tests.runs.replay.replays import read, store_of, write
from tools.bench.tables import FAILED, NOT_MEASURED, Table, Tell

TITLE = "An image of 640 x 480 becomes 1280 x 960"
# Rows and columns, and how many images.
SHAPE = (480, 640)
IMAGES = 20

_HARDWARE, _NUMPY, _OPENCV, _LIVE = (
    "hardware at 100 MHz",
    "node of the processor, NumPy",
    "node of the processor, OpenCV",
    "firm live, simulated",
)
_SPEC = CPU_NODE.with_name("resize.yaml")
_IMAGE = "sensor_msgs/msg/Image"
_COLUMNS = ("way", "median, ms", "longest, ms", "largest difference")
_NOTE = f"""
    {IMAGES} images of noise in rgb8, one after the other. The first row is what `firm replay --latency` adds to the
    stamps: the time from the first beat of a message into the hardware to the last beat of its response. The other rows
    are the times from a publishing call in rclpy to the callback, on this machine: they contain both ways through ROS.
    `firm live` connects the same topics to the hardware in Verilator, whose cycles take longer than those of hardware.
    'largest difference' is that to the model's values. RobotPerf measures its own message types and nodes with its own
    tools, so none of these figures is a result of RobotPerf.
    """


def keys() -> dict[str, list[tuple[str, ...]]]:
    """Return the first cell of every row, by table."""
    return {TITLE: [(name,) for name in (_HARDWARE, _NUMPY, _OPENCV, _LIVE)]}


def measure(seed: int, tell: Tell) -> list[Table]:
    """Measure all ways; `tell` receives the progress."""
    rows = []
    for name, measurement in _measurements().items():
        with tempfile.TemporaryDirectory() as folder:
            try:
                rows.append((name, *measurement(Path(folder), seed)))
            except (AssertionError, InputError, OSError) as error:
                tell(f"{name}: {error}")
                rows.append((name, "", "", FAILED))
        tell(" ".join(rows[-1]))
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def _measurements() -> dict[str, Callable[[Path, int], tuple[str, ...]]]:
    return {
        _HARDWARE: _replayed,
        _NUMPY: lambda folder, seed: _node(folder, seed, []),
        _OPENCV: _with_opencv,
        _LIVE: lambda folder, seed: _node(folder, seed, None),
    }


def _replayed(folder: Path, seed: int) -> tuple[str, ...]:
    images, store = noise(SHAPE, IMAGES, seed), store_of("mcap")
    items = [
        ("/camera/image_raw", _IMAGE, 10**18 + number * 10**9, _payload(store, image))
        for number, image in enumerate(images)
    ]
    source, target = write(folder / "in", "mcap", items), folder / "out"
    built = build_simulator(_SPEC, "verilator", build_root=folder / "build", sources=CoreSources())
    with contextlib.redirect_stdout(io.StringIO()):
        settings = Settings({}, 1000, has_latency=True)
        loaded = load_system(_SPEC, libraries((), None, None))
        replay(loaded, Source(source), Target(target), settings, lambda: Simulator(built.command(), built.folder))
    answers = read(target)
    assert len(answers) == IMAGES, f"{len(answers)} of {IMAGES} images came back"
    model = load_model("resize")
    for image, (*_, data) in zip(images, answers, strict=True):
        found: Any = store.deserialize_cdr(data, _IMAGE)
        assert bytes(found.data) == model.doubled(image).tobytes()
    seconds = [(answer[2] - item[2]) / 1e9 for item, answer in zip(items, answers, strict=True)]
    return (*_times(seconds), "0")


def _payload(store: Typestore, image: np.ndarray[Any, Any]) -> bytes:
    types = store.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "camera")
    height, width, channels = image.shape
    message = types[_IMAGE](header, height, width, "rgb8", 0, width * channels, image.reshape(-1))
    return bytes(store.serialize_cdr(message, _IMAGE))


def _with_opencv(folder: Path, seed: int) -> tuple[str, ...]:
    with running_ros(2, folder) as ros:
        if subprocess.run([ros.python, "-c", "import cv2"], capture_output=True, check=False).returncode:
            return "", "", NOT_MEASURED
    return _node(folder, seed, ["--opencv"])


def _node(folder: Path, seed: int, options: list[str] | None) -> tuple[str, ...]:
    """Measure the processor's node, or, without `options`, `firm live`."""
    if reason := missing_ros(2):
        raise OSError(reason)
    with running_ros(2, folder) as ros:
        log = folder / "node.log"
        if options is None:
            arguments = ["live", str(_SPEC), "--tool", "verilator", "--build-root", str(folder / "build")]
            process: NodeProcess = LiveNode(ros, log, arguments)
        else:
            process = NodeProcess(log, [ros.python, str(CPU_NODE), *options], dict(ros.environment))
        with process as node:
            seconds, largest = resized(ros, folder, SHAPE, IMAGES, seed)
            assert node.stop() == 0, node.said()
    return (*_times(seconds), str(largest))


def _times(seconds: list[float]) -> tuple[str, str]:
    return f"{1000 * statistics.median(seconds):.2f}", f"{1000 * max(seconds):.2f}"
