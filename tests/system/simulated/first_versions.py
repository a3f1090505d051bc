"""What first versions of accelerators are sent, and the zeros that they answer with, for stimuli and models."""

from __future__ import annotations

from pathlib import Path

# A message with arrays of fixed size whose elements vary, one within the other.
BOARD = "demo_msgs/Board"
_DEFINITIONS = {
    "Mark": "uint8 kind\nstring[2] labels\nfloat64[] ways\n",
    "Board": "uint32 number\nMark[3] marks\nstring[] rest\nbool is_done\n",
}

IMAGE_STIMULUS = """
- image:
    header: {seq: 1, stamp: {sec: 2, nsec: 3}, frame_id: here}
    height: 2
    width: 3
    encoding: mono8
    is_bigendian: 0
    step: 3
    data: [1, 2, 3, 4, 5, 6]
"""
ZEROS = """
ZEROS = {"x": 0.0, "y": 0.0, "z": 0.0}
POSE = {"position": ZEROS, "orientation": {**ZEROS, "w": 0.0}}
STAMP = {"sec": 0, "nsec": 0}
IMAGE = {"header": {"seq": 0, "stamp": STAMP, "frame_id": ""}, "height": 0, "width": 0, "encoding": "",
         "is_bigendian": 0, "step": 0, "data": []}
# The fields of the stimulus' image, without its strings and arrays.
FIELDS = {**IMAGE, "header": {"seq": 1, "stamp": {"sec": 2, "nsec": 3}, "frame_id": ""}, "height": 2, "width": 3,
          "step": 3}
BOARD = {"number": 0, "marks": [{"kind": 0, "labels": ["", ""], "ways": []}] * 3, "rest": [], "is_done": False}
"""


def write_messages(folder: Path) -> Path:
    """The package of `BOARD` below `folder`: a folder with message definitions."""
    package = folder / "demo_msgs"
    (package / "msg").mkdir(parents=True)
    for name, text in _DEFINITIONS.items():
        (package / "msg" / f"{name}.msg").write_text(text, encoding="utf-8")
    return package
