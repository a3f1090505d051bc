"""The replica of RobotPerf's a5: the model against its definition, and the system against the model."""

from __future__ import annotations

import math
import random
import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from tests.applications.images import (
    Message,
    break_frames,
    broken_images,
    copied,
    fed,
    header,
    image,
    load_model,
    odd_images,
    random_images,
    replace_by_netlists,
)
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem

SEED = seeded(20261126)
MODEL = load_model("resize")
ENTITIES = ("resize_image", "resize_size", "resize_matrices")
WATCHDOG = 3000


@pytest.mark.parametrize("shape", [(4, 5), (1, 1), (1, 6), (6, 1), (2, 2)])
def test_a_pixel_lies_a_quarter_of_the_way_to_the_next(shape: tuple[int, int]) -> None:
    """The definition of bilinear interpolation, between the centers of pixels, in exact numbers."""
    pixels = np.random.default_rng(SEED).integers(0, 256, (*shape, 3), dtype=np.uint8)
    found = MODEL.doubled(pixels)
    assert found.shape == (2 * shape[0], 2 * shape[1], 3)

    def near(place: int, size: int) -> list[tuple[int, Fraction]]:
        """The two pixels of a dimension, each with its weight."""
        center = Fraction(2 * place + 1, 4) - Fraction(1, 2)
        first = math.floor(center)
        weight = center - first
        return [(min(max(first, 0), size - 1), 1 - weight), (min(max(first + 1, 0), size - 1), weight)]

    for y, x, channel in np.ndindex(found.shape):
        parts = [(int(pixels[j, i, channel]), a * b) for j, a in near(y, shape[0]) for i, b in near(x, shape[1])]
        exact = sum(value * weight for value, weight in parts)
        assert found[y, x, channel] == math.floor(exact + Fraction(1, 2))


def test_a_number_doubles_as_numpy_doubles_it() -> None:
    """Of K and P, two rows of three; the third is without a unit."""
    message = {**info(random.Random(SEED)), "k": [1.5] * 9, "p": [1e308, math.inf, 5e-324, -0.0] * 3}
    found = MODEL.resized_info(message)
    assert found["k"] == [3.0] * 6 + [1.5] * 3
    with np.errstate(over="ignore"):
        assert found["p"] == [*(2 * np.array(message["p"][:8])), *message["p"][8:]]


def number(source: random.Random) -> float:
    """Any finite or infinite float64, often one at a border of its kinds."""
    exponent = source.choice((0, 1, 2045, 2046, source.randrange(2047)))
    fraction = source.choice((0, 1, 2**51, 2**52 - 1, source.getrandbits(52)))
    if source.randrange(20) == 0:
        exponent, fraction = 2047, 0
    (found,) = struct.unpack("<d", struct.pack("<Q", source.getrandbits(1) << 63 | exponent << 52 | fraction))
    return float(found)


def size(source: random.Random) -> int:
    """A size in pixels, often one at a border of uint32."""
    return source.choice((0, 1, 2**31, 2**32 - 1, source.getrandbits(32)))


def info(source: random.Random) -> Message:
    """A random calibration."""
    roi = {name: size(source) for name in ("x_offset", "y_offset", "height", "width")}
    return {
        "header": header("ROS2", source, "i" * source.randrange(40)),
        "height": size(source),
        "width": size(source),
        "distortion_model": "d" * source.randrange(30),
        "d": [number(source) for _ in range(source.randrange(9))],
        **{name: [number(source) for _ in range(count)] for name, count in (("k", 9), ("r", 9), ("p", 12))},
        "binning_x": size(source),
        "binning_y": size(source),
        "roi": {**roi, "do_rectify": bool(source.getrandbits(1))},
    }


def made(folder: Path, width: int, images: list[Message], infos: int, source: random.Random) -> GeneratedSystem:
    messages = [("camera", message) for message in images] + [("info", info(source)) for _ in range(infos)]
    source.shuffle(messages)
    return fed(copied(folder, "resize", width), messages)


@pytest.mark.parametrize("width", [64, 128])
@pytest.mark.one_in(2)
def test_images_and_calibrations_of_all_kinds(tmp_path: Path, width: int) -> None:
    source = random.Random(SEED + width)
    print(f"seed {SEED + width}")
    images = odd_images("ROS2", source, 3) + broken_images("ROS2", source, 3) + random_images("ROS2", source, 3, 8)
    system = made(tmp_path, width, images, 30, source)
    assert system.passes(SEED=SEED, STALL_PERCENT=50, WATCHDOG=WATCHDOG)
    assert system.work.latches("resize_image", {"WIDTH": width}) == []
    replace_by_netlists(system, ENTITIES[:1], width)
    assert system.passes(SEED=SEED, STALL_PERCENT=0, WATCHDOG=WATCHDOG)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("is_too_wide", [False, True])
def test_an_image_that_is_too_wide_or_breaks_off_does_not_harm_the_next(tmp_path: Path, is_too_wide: bool) -> None:
    source = random.Random(SEED)
    sizes = [(1, 2048), (1, 2049), (1, 2)] if is_too_wide else [(20, 30)] * 6
    system = made(tmp_path, 128, [image("ROS2", source, *size, 3) for size in sizes], 0, source)
    if not is_too_wide:
        break_frames(system, source, 20 * 30 * 3, 16)
    assert system.passes(SEED=SEED, STALL_PERCENT=30, WATCHDOG=WATCHDOG)


def test_two_pixels_fit_a_beat(tmp_path: Path) -> None:
    source = random.Random(SEED)
    system = made(tmp_path, 64, [image("ROS2", source, 1, 1, 3)], 0, source)
    found = system.work.run("resize_image", {"WIDTH": 32}, options=["--stop-time=1ns"])
    assert found.exit_code != 0
    assert "WIDTH is 32; legal: 48 or more" in found.output
