"""The models of the systems for images against their definitions, pixel by pixel, on noise and on a photograph."""

from __future__ import annotations

import random
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml

from tests.applications.images import SPECS, broken_images, image, load_model
from tests.seeds import seeded

PIPELINE, SOBEL = load_model("image_pipeline"), load_model("sobel")
SEED = seeded(20240701)
Pixels = npt.NDArray[np.uint8]


def noise(*shape: int) -> Pixels:
    return np.random.default_rng(SEED).integers(0, 256, shape, dtype=np.uint8)


@cache
def photograph(name: str) -> Pixels:
    """The first of a system's stimuli."""
    (first, *_) = yaml.load((SPECS / name / "stimuli.yaml").read_text(encoding="utf-8"), Loader=yaml.CSafeLoader)
    message = first["camera"]
    shape = (message["height"], message["width"], 3)[: 3 if message["encoding"] == "rgb8" else 2]
    return np.array(message["data"], np.uint8).reshape(shape)


@pytest.mark.parametrize("is_photograph", [False, True])
def test_gray(is_photograph: bool) -> None:
    """Within a unit of ITU-R BT.601."""
    pixels = photograph("image_pipeline") if is_photograph else noise(20, 30, 3)
    found = PIPELINE.gray(pixels)
    for row, column in np.ndindex(found.shape):
        red, green, blue = map(int, pixels[row, column])
        assert found[row, column] == (77 * red + 150 * green + 29 * blue + 128) // 256
        exact = Fraction(299 * red + 587 * green + 114 * blue, 1000)
        assert abs(found[row, column] - exact) < 1


def test_gray_and_white_stay() -> None:
    levels = np.repeat(np.arange(256, dtype=np.uint8), 3).reshape(16, 16, 3)
    assert (PIPELINE.gray(levels) == levels[:, :, 0]).all()


@pytest.mark.parametrize("ratios", [((1, 3), (4, 9)), ((2, 3), (5, 7)), ((1, 1), (1, 20))])
def test_scaled(ratios: tuple[tuple[int, int], tuple[int, int]]) -> None:
    pixels = noise(29, 31)
    (out_x, of_x), (out_y, of_y) = ratios
    found = PIPELINE.scaled(pixels, *ratios)
    for y, x in np.ndindex(found.shape):
        assert found[y, x] == pixels[y * of_y // out_y, x * of_x // out_x]
    # One pixel more would lie outside.
    assert found.shape[0] * of_y // out_y >= 29 and found.shape[1] * of_x // out_x >= 31


def test_full_hd_becomes_vga() -> None:
    assert PIPELINE.scaled(np.zeros((1080, 1920), np.uint8)).shape == (480, 640)


@pytest.mark.parametrize("is_photograph", [False, True])
def test_integral(is_photograph: bool) -> None:
    pixels = photograph("sobel")[:20] if is_photograph else noise(9, 14)
    found = PIPELINE.integral(pixels)
    for y, x in np.ndindex(pixels.shape):
        assert found[y, x] == pixels[: y + 1, : x + 1].sum(dtype=np.int64)


@pytest.mark.parametrize("shape", [(9, 14), (1, 1), (1, 5), (5, 1), None])
def test_edges(shape: tuple[int, int] | None) -> None:
    pixels = noise(*shape) if shape else photograph("sobel")
    kernel = ((-1, 0, 1), (-2, 0, 2), (-1, 0, 1))
    height, width = pixels.shape
    found = SOBEL.edges(pixels)
    for y, x in np.ndindex(pixels.shape):
        around = [
            [int(pixels[min(max(y + j, 0), height - 1), min(max(x + i, 0), width - 1)]) for i in (-1, 0, 1)]
            for j in (-1, 0, 1)
        ]
        across = sum(kernel[j][i] * around[j][i] for j in range(3) for i in range(3))
        down = sum(kernel[i][j] * around[j][i] for j in range(3) for i in range(3))
        assert found[y, x] == min(abs(across) + abs(down), 255)


@pytest.mark.parametrize(("model", "channels"), [(PIPELINE, 3), (SOBEL, 1)])
def test_what_is_no_image_becomes_an_empty_one(model: Any, channels: int) -> None:
    source = random.Random(SEED)
    for message in broken_images("ROS", source, channels):
        (*_, (_, answer)) = model.respond("camera", message)
        assert [answer[field] for field in ("height", "width", "step", "data")] == [0, 0, 0, b""]
    (*_, (_, answer)) = model.respond("camera", image("ROS", source, 3, 5, channels))
    assert answer["data"]


@pytest.mark.parametrize("name", ["image_pipeline", "sobel", "multi_type"])
def test_another_subscriber_is_unknown(name: str) -> None:
    with pytest.raises(ValueError, match="unknown subscriber 'nobody'"):
        load_model(name).respond("nobody", {})
