"""Systems of specs/ that work on images: copied, changed by a word, fed with images of all kinds, built and run."""

from __future__ import annotations

import importlib.util
import math
import random
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from tests.hdl.ghdl import REPOSITORY
from tests.system.simulated.systems import GeneratedSystem, build, call

SPECS = REPOSITORY / "specs"
CORES = ("acc/image/image",)

Message = dict[str, Any]


def load_model(name: str) -> ModuleType:
    """The model of a system."""
    found = importlib.util.spec_from_file_location(f"{name}_model", SPECS / name / "model.py")
    assert found and found.loader
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def filtered(model: ModuleType, entity: str, message: Message) -> Message:
    """What one accelerator makes of an image."""
    found: Message = model.ACCELERATORS[entity](message)
    return found


def header(ros: str, source: random.Random, frame_id: str = "camera") -> Message:
    """A header of `ROS` or `ROS2` with a random stamp."""
    seconds, fraction = source.getrandbits(31), source.randrange(10**9)
    if ros == "ROS2":
        return {"stamp": {"sec": seconds, "nanosec": fraction}, "frame_id": frame_id}
    return {"seq": source.getrandbits(32), "stamp": {"sec": seconds, "nsec": fraction}, "frame_id": frame_id}


def image(
    ros: str,
    source: random.Random,
    height: int,
    width: int,
    channels: int,
    padding: int = 0,
    frame_id: str = "camera",
) -> Message:
    """A noise image in rgb8 or mono8."""
    step = width * channels + padding
    return {
        "header": header(ros, source, frame_id),
        "height": height,
        "width": width,
        "encoding": "rgb8" if channels == 3 else "mono8",
        "is_bigendian": source.randrange(2),
        "step": step,
        "data": source.randbytes(height * step),
    }


def broken_images(ros: str, source: random.Random, channels: int) -> list[Message]:
    """Images that nobody can work on, each for another reason."""

    def one(**changed: Any) -> Message:
        return {**image(ros, source, 3, 5, channels), **changed}

    size = 3 * 5 * channels
    return [
        one(encoding="bgr8"),
        one(encoding=""),
        one(encoding="mono16" if channels == 1 else "rgba8"),
        one(encoding="rgb8mono8" if channels == 3 else "mono"),
        one(data=source.randbytes(size - 1)),
        one(data=source.randbytes(size + 1)),
        one(data=b""),
        one(step=5 * channels - 1, data=source.randbytes(3 * (5 * channels - 1))),
        one(step=0),
        one(width=6),
        one(width=2**32 - 1),
        one(height=2**16, step=0, data=b""),
        one(height=2**32 - 1, width=2**31),
        # 2**16 * 2**16 is 0 in 32 bits.
        one(height=2**15, width=1, step=2**17, data=b""),
    ]


def odd_images(ros: str, source: random.Random, channels: int) -> list[Message]:
    """Images of every kind that is an image."""
    sizes = [(0, 0), (0, 7), (5, 0), (1, 1), (1, 2), (2, 1), (3, 3), (1, 40), (40, 1), (2, 16), (3, 17), (9, 15)]
    found = [image(ros, source, *size, channels, source.choice((0, 1, 2, 35))) for size in sizes]
    for frame_id in ("", "x", "a" * 255, "b" * 256, "c" * 257, "d" * 400):
        found.append(image(ros, source, 2, 3, channels, frame_id=frame_id))
    return found


def random_images(ros: str, source: random.Random, channels: int, count: int, largest: int = 24) -> list[Message]:
    """Noise of random sizes."""
    return [
        image(
            ros,
            source,
            source.randint(1, largest),
            source.randint(1, largest),
            channels,
            source.choice((0, 0, 1, source.randrange(100))),
            "f" * source.randrange(40),
        )
        for _ in range(count)
    ]


def copied(folder: Path, name: str, width: int | None = None, ros: str = "ROS") -> Path:
    """A copy of a system's folder, at another width and, for ROS2, with the word `ROS` changed everywhere."""
    copy = folder / name
    shutil.copytree(SPECS / name, copy)
    spec = copy / f"{name}.yaml"
    text = spec.read_text(encoding="utf-8")
    if width is not None:
        text = re.sub(r"width: \d+", f"width: {width}", text)
    spec.write_text(text.replace("middleware: ROS,", f"middleware: {ros},"), encoding="utf-8")
    return copy


def built(copy: Path, stimuli: Path) -> GeneratedSystem:
    """The system of a copy, with its simulation, in the folder `work` beside it."""
    return build(call(copy / f"{copy.name}.yaml", stimuli, copy / "model.py"), copy.parent / "work", *CORES)


def fed(copy: Path, messages: Sequence[tuple[str, Message]]) -> GeneratedSystem:
    """The same, with messages, each with the subscriber that it goes to."""
    stimuli = copy / "random.yaml"
    stimuli.write_text("".join(f"- {block}: {yaml_of(message)}\n" for block, message in messages), encoding="utf-8")
    return built(copy, stimuli)


def replace_by_netlists(made: GeneratedSystem, entities: Sequence[str], width: int) -> None:
    """Put the netlists of accelerators in their places; parts that two of them have need two names."""
    for entity in entities:
        netlist = made.work.synthesise(entity, {"WIDTH": width})
        for part in re.findall(r"^entity (\w+) is", netlist, re.MULTILINE):
            if part != entity:
                netlist = re.sub(rf"\b{part}\b", f"{part}_of_{entity}", netlist)
        file = made.folder / f"{entity}_netlist.vhd"
        file.write_text(netlist, encoding="utf-8")
        made.work.analyse([file])
    made.work.analyse(made.folder / f"{made.entity}{end}.vhd" for end in ("", "_tb"))


def yaml_of(value: Any) -> str:
    """A value in flow style; bytes are a list of numbers."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {yaml_of(item)}" for key, item in value.items()) + "}"
    if isinstance(value, bytes | list):
        return "[" + ", ".join(map(yaml_of, value)) + "]"
    if isinstance(value, float) and math.isinf(value):
        return ".inf" if value > 0 else "-.inf"
    return f"'{value}'" if isinstance(value, str) else repr(value)


def break_frames(
    made: GeneratedSystem, source: random.Random, size: int, lanes: int, *, in_header: bool = True
) -> None:
    """Cut two of three frames with `size` bytes of pixels: one `in_header`, if wanted, the others among the pixels."""
    stimuli, answers = (made.folder / f"{file}.txt" for file in ("stimulus", "expected"))
    frames, expected = (re.split(r"^[<>] .*\n", file.read_text(encoding="ascii"), flags=re.MULTILINE)[1:]
                        for file in (stimuli, answers))  # fmt: skip
    pixels = len(bytes.fromhex(frames[0])) - size
    sent, wanted, errors = "", "", 0
    for number, (frame, answer) in enumerate(zip(frames, expected, strict=True)):
        data, shown = bytes.fromhex(frame), answer
        if number % 3 == 0 and in_header:
            data, shown, errors = data[: source.randrange(6, pixels - 2 * lanes)], "", errors + 1
        elif number % 3 < 2:
            # Not among the beats that all blocks take before the last one has announced its image.
            data = data[: source.randrange(pixels + 100 * lanes, len(data) - lanes)]
            id_ = int(answer.split()[0], 16)
            shown, errors = f"{id_:02x}\n! aborted {id_} 10", errors + 2
        sent += f"> {number}\n  {data.hex()}\n"
        wanted += f"< @{number} {number}\n  {shown}\n" if shown else ""
    stimuli.write_text(sent, encoding="ascii")
    answers.write_text(f"! frame_error {errors}\n{wanted}", encoding="ascii")
