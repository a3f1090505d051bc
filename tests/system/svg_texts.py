"""The faults of a picture in SVG that Graphviz or matplotlib drew: texts over each other, over lines, or cut off."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import matplotlib as mpl
from PIL import ImageFont

_MATPLOTLIB: Any = mpl
# Of the widest of the usual fonts without serifs.
_FONT = Path(_MATPLOTLIB.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
_POINTS = 16


@dataclass(frozen=True)
class Box:
    """A rectangle of a text, in the picture's units; `y` grows downwards."""

    text: str
    left: float
    top: float
    right: float
    bottom: float

    def meets(self, other: Box) -> bool:
        """Whether both rectangles have a common part."""
        return not (
            self.right <= other.left or other.right <= self.left or self.bottom <= other.top or other.bottom <= self.top
        )

    def contains(self, x: float, y: float) -> bool:
        """Whether a point is inside."""
        return self.left < x < self.right and self.top < y < self.bottom


def faults(svg: bytes, pixels: int) -> list[str]:
    """Return all faults of a picture that is shown at most `pixels` wide; letters need a height of 9 pixels."""
    root = ET.fromstring(svg)
    width = float(root.attrib["width"].removesuffix("pt")) * 96 / 72
    scale = min(1.0, pixels / width)
    texts = [*_texts(root)]
    left, top, wide, high = (float(word) for word in root.attrib["viewBox"].split())
    found = [f"{one.text!r} over {two.text!r}" for one, two in combinations(texts, 2) if one.meets(two)]
    sizes = {float(item.attrib["font-size"]) for item in root.iter() if _is(item, "text")}
    if min(sizes) * scale * 96 / 72 < 9:
        found.append(f"{min(sizes) * scale * 96 / 72:.1f} pixels are too small for letters")
    dx, dy = _moved(root)
    found += [
        f"{box.text!r} is cut"
        for box in texts
        if box.left + dx < left or box.right + dx > left + wide or box.top + dy < top or box.bottom + dy > top + high
    ]
    edges = [item for item in root.iter() if item.attrib.get("class", "").startswith("edge")]
    lines = [point for edge in edges for item in edge if _is(item, "path") for point in _points(item.attrib["d"])]
    return found + [f"a line through {box.text!r}" for box in texts if any(box.contains(x, y) for x, y in lines)]


def _moved(root: ET.Element) -> tuple[float, float]:
    """The distance by which Graphviz moves everything."""
    (group,) = (item for item in root if _is(item, "g"))
    found = re.search(r"translate\((\S+)[ ,](\S+)\)", group.attrib["transform"])
    assert found
    return float(found[1]), float(found[2])


def _texts(root: ET.Element) -> Iterator[Box]:
    for item in root.iter():
        if _is(item, "text") and (text := "".join(item.itertext()).strip("\u00a0 ")):
            x, y, size = (float(item.attrib[name]) for name in ("x", "y", "font-size"))
            wide = ImageFont.truetype(_FONT, 100).getlength(text) * size / 100
            left = x - wide * {"start": 0, "middle": 0.5, "end": 1}[item.attrib.get("text-anchor", "start")]
            # Without the space between lines, and without the descenders.
            yield Box(text, left, y - 0.72 * size, left + wide, y)


def _points(path: str) -> Iterator[tuple[float, float]]:
    """The points of the cubic curves of an edge."""
    numbers = [float(word) for word in re.findall(r"-?\d+(?:\.\d+)?", path)]
    corners = [*zip(numbers[::2], numbers[1::2], strict=True)]
    for k in range(0, len(corners) - 3, 3):
        for step in range(_POINTS + 1):
            t = step / _POINTS
            weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3)
            x, y = (
                sum(w * point[axis] for w, point in zip(weights, corners[k : k + 4], strict=True)) for axis in (0, 1)
            )
            yield x, y


def _is(item: ET.Element, name: str) -> bool:
    return item.tag.endswith(f"}}{name}")
