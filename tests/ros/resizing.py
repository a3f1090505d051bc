"""Images to a node that makes them twice as large, and back."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tests.applications.images import load_model
from tests.ros.cpp_nodes import Ros
from tests.ros.live_nodes import SPECS

CPU_NODE = SPECS / "resize" / "cpu_node.py"
_CALIBRATION = [[3.0] * 6 + [1.5] * 3, [-0.5] * 8 + [-0.25] * 4, 6]


def noise(shape: tuple[int, int], count: int, seed: int) -> list[npt.NDArray[np.uint8]]:
    """Images of noise, each (rows, columns, 3)."""
    source = np.random.default_rng(seed)
    return [source.integers(0, 256, (*shape, 3), dtype=np.uint8) for _ in range(count)]


def resized(ros: Ros, folder: Path, shape: tuple[int, int], count: int, seed: int) -> tuple[list[float], int]:
    """Send noise images to the node that runs.

    Returns the seconds until each is back, and the largest difference of a value from the model's. Raises
    `AssertionError` if a size or the calibration is wrong.
    """
    model, images = load_model("resize"), noise(shape, count, seed)
    for number, image in enumerate(images):
        (folder / f"{number}.in").write_bytes(image.tobytes())
    command = [ros.python, str(Path(__file__).with_name("image_peer.py")), str(folder), *map(str, shape), str(count)]
    done = subprocess.run(command, env=dict(ros.environment), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    seconds, sizes, calibration = json.loads(done.stdout)
    rows, columns = (2 * size for size in shape)
    assert sizes == [rows, columns, 3 * columns, "rgb8"]
    assert calibration == [rows, columns, *_CALIBRATION]
    largest = 0
    for number, image in enumerate(images):
        found = np.frombuffer((folder / f"{number}.out").read_bytes(), np.uint8).reshape(rows, columns, 3)
        largest = max(largest, int(np.abs(found.astype(int) - model.doubled(image)).max()))
    return [float(value) for value in seconds], largest
