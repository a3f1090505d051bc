"""Systems of which a part is software: the hardware's part in simulation, for the same results wherever a block is."""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Collection
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.text.diagnostics import InputError
from tests.applications.images import SPECS, broken_images, built, copied, fed, image, load_model, odd_images
from tests.seeds import seeded
from tests.system.simulated.systems import DATA, GeneratedSystem, build, call

SEED = seeded(20240803)

# --- messages of fixed size ------------------------------------------------------------------------------------------

# An accelerator in software behind one in hardware, and in front of one: what it gives goes to hardware, to software
# and to a publisher, and what it takes goes to a publisher, too. `joined` takes one message from each part.
MIXED = """\
project: {name: mixed, width: 32}
accelerators:
  - name: rotate
    type: VHDL
    sources: rotate.vhd
    interface:
      input: [{middleware: ROS, message: geometry_msgs/Vector3}]
      output: [{middleware: ROS, message: geometry_msgs/Vector3}]
  - name: merge
    type: VHDL
    sources: merge.vhd
    interface:
      input: [{middleware: ROS, message: geometry_msgs/Point}, {middleware: ROS, message: geometry_msgs/Vector3}]
      output: [{middleware: ROS, message: geometry_msgs/Point}, {middleware: ROS, message: geometry_msgs/Point}]
  - name: scale
    type: ROS-SW
    sources: functions.py
    interface:
      input: [{middleware: ROS, message: geometry_msgs/Vector3}]
      output: [{middleware: ROS, message: geometry_msgs/Vector3}]
blocks:
  - {name: vector, middleware: ROS, mode: subscriber, message: geometry_msgs/Vector3, outgoing: [{name: first}]}
  - {name: point, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: joined}]}
  - {name: first, type: rotate, outgoing: [{name: raw}, {name: scaled}]}
  - {name: scaled, type: scale, outgoing: [{name: second}, {name: twice}, {name: near}]}
  - {name: twice, type: scale, outgoing: [{name: joined}]}
  - {name: second, type: rotate, outgoing: [{name: far}]}
  - {name: joined, type: merge, outgoing: [{name: left}, {name: right}]}
  - {name: raw, middleware: ROS, mode: publisher, message: geometry_msgs/Vector3}
  - {name: near, middleware: ROS, mode: publisher, message: geometry_msgs/Vector3}
  - {name: far, middleware: ROS, mode: publisher, message: geometry_msgs/Vector3}
  - {name: left, middleware: ROS, mode: publisher, message: geometry_msgs/Point}
  - {name: right, middleware: ROS, mode: publisher, message: geometry_msgs/Point}
"""
FUNCTIONS = """\
def rotate(m):
    return {"x": m["z"], "y": m["x"], "z": m["y"]}


def scale(m):
    return {name: 2 * value for name, value in m.items()}


def merge(point, vector):
    return {**point, "y": vector["y"]}, {**vector, "y": point["y"]}
"""
# The model of all parts: whatever goes to an accelerator counts where that is software.
MODEL = """\
POINTS = []


def moved(m):
    return {"x": m["z"], "y": m["x"], "z": m["y"]}


def times(m, factor):
    return {name: factor * value for name, value in m.items()}


def respond(subscriber, m):
    if subscriber == "point":
        POINTS.append(m)
        return [("joined_in0", m)]
    first = moved(m)
    scaled, twice, point = times(first, 2), times(first, 4), POINTS.pop(0)
    return [
        ("first_in", m), ("raw", first), ("scaled_in", first), ("twice_in", scaled), ("near", scaled),
        ("second_in", scaled), ("far", moved(scaled)), ("joined_in1", twice),
        ("left", {**point, "y": twice["y"]}), ("right", {**twice, "y": point["y"]}),
    ]
"""


def mixed(
    folder: Path, moved: Collection[str] = (), ros: str = "ROS", model: str = MODEL, functions: str = FUNCTIONS
) -> GeneratedSystem:
    """The system with further accelerators `moved` from hardware to software: a word each, and their sources."""
    folder.mkdir(exist_ok=True)
    text = MIXED.replace("middleware: ROS", f"middleware: {ros}")
    for name in moved:
        before = f"type: VHDL\n    sources: {name}.vhd"
        assert before in text
        text = text.replace(before, "type: ROS-SW\n    sources: functions.py")
    for name, content in (("mixed.yaml", text), ("functions.py", functions), ("model.py", model)):
        (folder / name).write_text(content, encoding="utf-8")
    for name in ("rotate.vhd", "merge.vhd"):
        shutil.copy(DATA / name, folder)
    source = random.Random(SEED)
    stimuli = [
        {block: {axis: source.uniform(-1e3, 1e3) for axis in "xyz"}} for _ in range(8) for block in ("point", "vector")
    ]
    (folder / "stimuli.yaml").write_text(yaml.safe_dump(stimuli), encoding="utf-8")
    return build(call(folder / "mixed.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def check(made: GeneratedSystem) -> None:
    for seed, stall_percent in ((1, 0), (2, 40), (3, 80)):
        assert made.passes(SEED=seed, STALL_PERCENT=stall_percent)


def frames(made: GeneratedSystem, publisher: str) -> list[str]:
    """What a publisher must send, without its id, which is another one elsewhere."""
    text = (made.folder / "expected.txt").read_text(encoding="ascii")
    found = re.findall(rf"^< (?:@\d+ )?{publisher} .*\n((?:  .*\n)+)", text, re.MULTILINE)
    return [re.sub(r"\A  [0-9a-f]{2}", "", frame) for frame in found]


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("moved", "ros", "publishers"),
    [
        ((), "ROS", ["far", "left", "raw", "right", "scaled_in"]),
        (("merge",), "ROS2", ["far", "raw", "scaled_in"]),
        (("rotate",), "ROS", ["left", "right"]),
    ],
)
def test_hardware_and_software_together(
    tmp_path: Path, moved: tuple[str, ...], ros: str, publishers: list[str]
) -> None:
    made = mixed(tmp_path, moved, ros)
    text = (made.folder / "expected.txt").read_text(encoding="ascii")
    assert sorted({line.split()[2] for line in text.splitlines() if line.startswith("<")}) == publishers
    check(made)
    assert made.work.latches(made.entity) == []


def test_wrong_software_fails_in_hardware_behind_it(tmp_path: Path) -> None:
    """What it sends there is not what the model thinks."""
    functions = FUNCTIONS.replace("2 * value", "3 * value")
    with pytest.raises(InputError, match="message 0 from software to 'near': 'x' is "):
        mixed(tmp_path, functions=functions)
    model = MODEL.replace('("near", scaled)', '("near", times(first, 3))')
    result = mixed(tmp_path, model=model, functions=functions).run()
    assert result.exit_code != 0
    assert re.search(r"'far geometry_msgs/Vector3 .*': byte \d+: expected", result.output)


def test_wrong_hardware_fails_in_front_of_software(tmp_path: Path) -> None:
    made = mixed(tmp_path)
    top = made.folder / f"{made.entity}.vhd"
    text = top.read_text(encoding="ascii")
    wrong = re.sub(r"(scaled_in_x +<= )(first_out_x)", r"\1not \2", text)
    assert wrong != text
    top.write_text(wrong, encoding="ascii")
    made.work.analyse([top, made.folder / f"{made.entity}_tb.vhd"])
    result = made.run()
    assert result.exit_code != 0
    assert re.search(r"'scaled_in geometry_msgs/Vector3 .*': byte \d+: expected", result.output)


def test_software_elsewhere(tmp_path: Path) -> None:
    """What it sends is in the stimuli, under the name that the derived system has for it."""
    text = MIXED.replace("    sources: functions.py\n", "")
    text = re.sub(r"(?m)^.*name: (twice|joined|left|right|near|point), .*\n", "", text)
    text = text.replace(", {name: twice}, {name: near}", "")
    model = """\
def respond(subscriber, m):
    moved = {"x": m["z"], "y": m["x"], "z": m["y"]}
    return [("raw", moved), ("scaled_in", moved)] if subscriber == "vector" else [("far", moved)]
"""
    stimuli = "".join(
        f"- {block}: {{x: {number}.5, y: {number}, z: -{number}}}\n"
        for number in range(5)
        for block in ("vector", "scaled_out")
    )
    for name, content in (("far.yaml", text), ("model.py", model), ("stimuli.yaml", stimuli)):
        (tmp_path / name).write_text(content, encoding="utf-8")
    for name in ("rotate.vhd", "merge.vhd"):
        shutil.copy(DATA / name, tmp_path)
    check(build(call(tmp_path / "far.yaml", tmp_path / "stimuli.yaml", tmp_path / "model.py"), tmp_path / "work"))


# --- images ----------------------------------------------------------------------------------------------------------


def pipeline(folder: Path, moved: Collection[str], width: int, ros: str) -> Path:
    """The image pipeline with accelerators in software that are taken from its model."""
    copy = copied(folder, "image_pipeline", width, ros)
    spec = copy / "image_pipeline.yaml"
    text = spec.read_text(encoding="utf-8")
    for name in moved:
        before = f"type: VHDL\n    sources: rtl/{name}.vhd"
        assert before in text
        text = text.replace(before, f"type: ROS-SW\n    sources: [{name}.py, model.py]")
        code = f'from model import ACCELERATORS\n\n{name} = ACCELERATORS["{name}"]\n'
        (copy / f"{name}.py").write_text(code, encoding="utf-8")
    spec.write_text(text, encoding="utf-8")
    return copy


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("moved", "width"),
    [
        (("rgb_to_gray",), 64),
        (("scale_down",), 8),
        (("rgb_to_gray", "integral_image"), 128),
    ],
)
def test_images_go_through_hardware_and_software(tmp_path: Path, moved: tuple[str, ...], width: int) -> None:
    print(f"seed {SEED + width}")
    source = random.Random(SEED + width)
    ros = source.choice(("ROS", "ROS2"))
    messages = [*odd_images(ros, source, 3)[::3], *broken_images(ros, source, 3)[::3], image(ros, source, 20, 33, 3)]
    source.shuffle(messages)
    check(fed(pipeline(tmp_path, moved, width, ros), [("camera", message) for message in messages]))


@pytest.mark.check
def test_two_words_move_an_accelerator_of_the_application(tmp_path: Path) -> None:
    """The type and the source: nothing else differs but name and comments. The last publisher's frames are the same."""
    folder = SPECS / "image_pipeline"
    lines = [
        [line for line in (folder / name).read_text(encoding="utf-8").splitlines() if not line.lstrip().startswith("#")]
        for name in ("image_pipeline.yaml", "image_pipeline_software.yaml")
    ]
    changes = [pair for pair in zip(*lines, strict=True) if pair[0] != pair[1]]
    assert [(before.strip(), after.strip()) for before, after in changes] == [
        ("name: image_pipeline", "name: image_pipeline_software"),
        ("type: VHDL", "type: ROS-SW"),
        ("sources: rtl/scale_down.vhd", "sources: software/scale_down.py"),
    ]
    made = []
    for name in ("image_pipeline", "image_pipeline_software"):
        copy = tmp_path / name / "image_pipeline"
        shutil.copytree(folder, copy)
        shutil.copy(folder / f"{name}.yaml", copy / "image_pipeline.yaml")
        made.append(built(copy, copy / "stimuli.yaml"))
    check(made[1])
    assert frames(made[0], "sums") == frames(made[1], "sums")
    assert len(frames(made[1], "sums")) == len(frames(made[1], "small_in")) == 7


def test_the_function_of_the_application_is_its_model() -> None:
    """On images of all kinds, broken ones as well."""
    scope: dict[str, object] = {}
    path = SPECS / "image_pipeline" / "software" / "scale_down.py"
    exec(compile(path.read_text(encoding="utf-8"), path.name, "exec"), scope)
    function, source = scope["scale_down"], random.Random(SEED)
    assert callable(function)
    messages = odd_images("ROS", source, 1) + broken_images("ROS", source, 1)
    messages.append({**image("ROS", source, 1, 65536, 1)})
    for message in messages:
        assert function(message) == load_model("image_pipeline").ACCELERATORS["scale_down"](message)


BUFFERED = """\
project: {name: buffered, width: 32, scheduler: fixed_priority_preemptive, shortestRun: 4}
accelerators:
  - name: invert
    type: VHDL
    sources: invert.vhd
    interface:
      input: [{middleware: ROS2, message: sensor_msgs/Image}]
      output: [{middleware: ROS2, message: sensor_msgs/Image, length: given}]
  - name: halve
    type: ROS-SW
    sources: halve.py
    interface:
      input: [{middleware: ROS2, message: sensor_msgs/Image}]
      output: [{middleware: ROS2, message: sensor_msgs/Image, length: given}]
blocks:
  - {name: sub, middleware: ROS2, mode: subscriber, message: sensor_msgs/Image, outgoing: [{name: first}]}
  - {name: first, type: invert, outgoing: [{name: raw}, {name: half}]}
  - {name: half, type: halve, buffer: 2000, outgoing: [{name: again}]}
  - {name: again, type: invert, outgoing: [{name: pub}]}
  - {name: raw, middleware: ROS2, mode: publisher, message: sensor_msgs/Image, buffer: 2000}
  - {name: pub, middleware: ROS2, mode: publisher, message: sensor_msgs/Image}
"""
HALVE = """\
def halve(m):
    return {**m, "data": m["data"][::2]}
"""
BUFFERED_MODEL = """\
def inverted(m):
    return {**m, "data": bytes(255 - byte for byte in m["data"])}

def respond(subscriber, m):
    found = inverted(m)
    half = {**found, "data": found["data"][::2]}
    return [("raw", found), ("half_in", found), ("pub", inverted(half))]
"""


def test_a_stream_goes_to_a_publisher_and_to_software(tmp_path: Path) -> None:
    """Both wait for it, so both have buffers; the scheduler interrupts one for the other."""
    source = random.Random(SEED)
    copy = tmp_path / "buffered"
    copy.mkdir()
    shutil.copy(DATA / "invert.vhd", copy)
    for name, content in (("buffered.yaml", BUFFERED), ("halve.py", HALVE), ("model.py", BUFFERED_MODEL)):
        (copy / name).write_text(content, encoding="utf-8")
    check(fed(copy, [("sub", image("ROS2", source, source.randrange(30), 17, 3)) for _ in range(8)]))
