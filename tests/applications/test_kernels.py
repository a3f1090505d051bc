"""Kernels of the dissertation in C++ for HLS: in simulation, they give what the models of specs/ give, bit by bit."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from tests.applications.applications import SPECS
from tests.applications.images import break_frames, broken_images, copied, fed, image, odd_images, random_images
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded
from tests.system.simulated.systems import build, call

DATA = Path(__file__).parent / "data"
SEED = seeded(20240902)
# Of the applications for images: the accelerator in C++ and its file.
IN_CPP = {"sobel": ("sobel", "Sobel.cpp"), "image_pipeline": ("rgb_to_gray", "RgbToGray.cpp")}
STATE = {"q": (7, 4.0), "q_d": (7, 16.5), "o_t_ee": (16, 1.5), "o_t_ee_d": (16, 4.02)}


def in_cpp(name: str, source: str, folder: Path, **changes: Any) -> Path:
    """The specification of an application in specs/ whose accelerator is written in C++."""
    specification = yaml.safe_load((SPECS / name / f"{name}.yaml").read_text(encoding="utf-8"))
    (accelerator,) = specification["accelerators"]
    accelerator |= {"type": "HLS", "sources": source, **changes}
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(specification, sort_keys=False), encoding="utf-8")
    (folder / source).write_text((DATA / source).read_text(encoding="utf-8"), encoding="utf-8")
    return path


@pytest.mark.parametrize("stalls", [0, 40])
def test_the_kinematics_of_the_arm(tmp_path: Path, stalls: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    states = yaml.safe_load((SPECS / "robotic_arm" / "stimuli.yaml").read_text(encoding="utf-8"))
    states += [
        {"state": {name: [source.uniform(-far, far) for _ in range(size)] for name, (size, far) in STATE.items()}}
        for _ in range(20)
    ]
    (tmp_path / "stimuli.yaml").write_text(yaml.safe_dump(states), encoding="utf-8")
    specification = in_cpp("robotic_arm", "RoboticArm.cpp", tmp_path)
    paths = [str(SPECS / "robotic_arm" / "msg")]
    request = call(specification, tmp_path / "stimuli.yaml", SPECS / "robotic_arm" / "model.py", paths=paths)
    result = build(request, tmp_path / "system").run(SEED=SEED, STALL_PERCENT=stalls)
    assert result.output.splitlines()[-1] == f"PASS {len(states)}/{len(states)}", result.output


PASS_THROUGH = """\
project: {name: pass}
accelerators:
  - name: forward
    type: HLS
    sources: forward.cpp
    interface:
      input: [{middleware: ROS2, message: geometry_msgs/PoseWithCovariance}]
      output: [{middleware: ROS2, message: geometry_msgs/PoseWithCovariance}]
blocks:
  - {name: sub, middleware: ROS2, mode: subscriber, message: geometry_msgs/PoseWithCovariance, outgoing: [{name: acc}]}
  - {name: acc, type: forward, outgoing: [{name: pub}]}
  - {name: pub, middleware: ROS2, mode: publisher, message: geometry_msgs/PoseWithCovariance}
"""


def test_the_first_version_copies_arrays(tmp_path: Path) -> None:
    specification = tmp_path / "pass.yaml"
    specification.write_text(PASS_THROUGH, encoding="utf-8")
    assert main(["system", "skeleton", str(specification)]) == 0
    assert "double pose_position_x_in" in (text := (tmp_path / "forward.cpp").read_text(encoding="utf-8"))
    assert "double covariance_out[36]" in text
    pose = {"position": {"x": 1.5, "y": -2.0, "z": 3.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    message = {"pose": pose, "covariance": [k / 8 for k in range(36)]}
    (tmp_path / "stimuli.yaml").write_text(yaml.safe_dump([{"sub": message}]), encoding="utf-8")
    (tmp_path / "model.py").write_text("def respond(_, message):\n    return [('pub', message)]\n", encoding="utf-8")
    request = call(specification, tmp_path / "stimuli.yaml", tmp_path / "model.py")
    assert build(request, tmp_path / "system").passes()


def with_streams(folder: Path, name: str, width: int) -> Path:
    """A copy of an application for images, of which one accelerator is written in C++ with streams."""
    copy = copied(folder, name, width)
    entity, source = IN_CPP[name]
    path = copy / f"{name}.yaml"
    specification = yaml.safe_load(path.read_text(encoding="utf-8"))
    (accelerator,) = (item for item in specification["accelerators"] if item["name"] == entity)
    accelerator |= {"type": "HLS", "sources": source}
    path.write_text(yaml.safe_dump(specification, sort_keys=False), encoding="utf-8")
    (copy / source).write_text((DATA / source).read_text(encoding="utf-8"), encoding="utf-8")
    return copy


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("name", "width"), [("sobel", 8), ("sobel", 64), ("image_pipeline", 32)])
def test_images_in_cpp(tmp_path: Path, name: str, width: int) -> None:
    """Gray scale and the Sobel filter, with images of all kinds and messages that are not valid images."""
    print(f"seed {SEED + width}")
    source = random.Random(SEED + width)
    channels = 3 if name == "image_pipeline" else 1
    messages = odd_images("ROS", source, channels) + broken_images("ROS", source, channels)
    messages += random_images("ROS", source, channels, 8)
    source.shuffle(messages)
    made = fed(with_streams(tmp_path, name, width), [("camera", message) for message in messages])
    assert made.passes(SEED=SEED, STALL_PERCENT=40)


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("name", "width"), [("sobel", 8), ("image_pipeline", 64)])
def test_an_image_that_breaks_off_restarts_the_function(tmp_path: Path, name: str, width: int) -> None:
    print(f"seed {SEED + width}")
    source = random.Random(SEED + width)
    channels = 3 if name == "image_pipeline" else 1
    messages = [image("ROS", source, 30, 50, channels) for _ in range(6)]
    made = fed(with_streams(tmp_path, name, width), [("camera", message) for message in messages])
    break_frames(made, source, 30 * 50 * channels, width // 8)
    for stalls in (0, 40):
        assert made.passes(SEED=SEED, STALL_PERCENT=stalls)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("taken", "given", "width"),
    [
        ("sensor_msgs/Image", "sensor_msgs/Image", 8),
        ("sensor_msgs/CameraInfo", "sensor_msgs/CompressedImage", 16),
        ("sensor_msgs/LaserScan", "geometry_msgs/Vector3Stamped", 64),
        ("geometry_msgs/Point", "std_msgs/String", 32),
        ("sensor_msgs/Range", "std_msgs/Bool", 8),
    ],
)
def test_the_first_version_copies_strings_and_arrays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken: str, given: str, width: int
) -> None:
    monkeypatch.chdir(tmp_path)
    options = ["--in", taken, "--out", given, "--language", "hls", "--width", str(width)]
    assert main(["init", "robot", *options]) == 0
    folder = tmp_path / "robot"
    request = call(folder / "robot.yaml", folder / "stimuli.yaml", folder / "model.py")
    assert build(request, tmp_path / "system").passes(SEED=SEED, STALL_PERCENT=50)


SLOPPY = """\
#include <cstdint>
#include <hls_stream.h>

void robot(
    hls::stream<std::uint32_t> &payload_length_in, hls::stream<std::uint32_t> &data_length_in,
    hls::stream<char> &data_in, hls::stream<std::uint32_t> &payload_length_out,
    hls::stream<std::uint32_t> &data_length_out, hls::stream<char> &data_out
) {
    const std::uint32_t length = data_length_in.read();
    payload_length_out.write(payload_length_in.read());
    data_length_out.write(length);
    // More than the length says, of an input that is not read.
    for (std::uint32_t k = 0; k < length + 3; k++) data_out.write('a' + k % 26);
}
"""


def test_unread_and_superfluous_elements_are_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    messages = ["std_msgs/String", "--out", "std_msgs/String", "--language", "hls", "--width", "32"]
    assert main(["init", "robot", "--in", *messages]) == 0
    folder = tmp_path / "robot"
    (folder / "hls" / "robot.cpp").write_text(SLOPPY, encoding="ascii")
    (folder / "model.py").write_text(
        "def respond(_, message):\n"
        "    letters = ''.join(chr(ord('a') + k % 26) for k in range(len(message['data'])))\n"
        "    return [('pub', {'data': letters})]\n",
        encoding="ascii",
    )
    stimuli = [{"sub": {"data": "x" * length}} for length in (0, 1, 3, 4, 5, 30)]
    (folder / "stimuli.yaml").write_text(yaml.safe_dump(stimuli), encoding="utf-8")
    request = call(folder / "robot.yaml", folder / "stimuli.yaml", folder / "model.py")
    assert build(request, tmp_path / "system").passes(SEED=SEED, STALL_PERCENT=30)


@pytest.mark.parametrize(
    ("entity", "generics"),
    [
        ("firm_hls_values", {"BITS": 64, "COUNT": 9}),
        ("firm_hls_results", {"BITS": 1, "COUNT": 3}),
        ("firm_hls_stream", {"BITS": 8, "WIDTH": 64}),
        ("firm_hls_stream", {"BITS": 64, "WIDTH": 8}),
    ],
)
def test_there_is_no_latch(tmp_path: Path, entity: str, generics: dict[str, Generic]) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files("axis/package", "axis/axis"))
    assert library.latches(entity, generics) == []


def test_the_wrapper_around_streams_has_no_latch(tmp_path: Path) -> None:
    """The kernel is left empty, since it is the HLS tool's."""
    made = fed(with_streams(tmp_path, "sobel", 64), [("camera", image("ROS", random.Random(SEED), 3, 4, 1))])
    text = (made.folder / "Sobel_kernel.vhd").read_text(encoding="ascii")
    entity = text[text.index("entity Sobel_kernel is") : text.index("architecture simulation")]
    stub = made.folder / "stub.vhd"
    head = "library ieee;\nuse ieee.std_logic_1164.all;\n"
    stub.write_text(f"{head}{entity}architecture stub of Sobel_kernel is\nbegin\nend architecture;\n", encoding="ascii")
    made.work.analyse([stub, made.folder / "sobel_wrapper.vhd"])
    assert made.work.latches("sobel_wrapper", {}) == []
