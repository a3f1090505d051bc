"""Systems whose accelerators run at other clocks and have streams of other widths, from host to host."""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.system.derived.sides import accelerator_ports
from fusesoc_firm.system.system_core import load_system
from tests.applications.images import Message, copied, fed, image, odd_images, random_images
from tests.cores.crossing_paths import Domains, unsynchronised
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded
from tests.system.simulated.systems import DATA, GeneratedSystem, build, call
from tests.system.simulated.test_variable_system import (
    ALL,
    COPIES,
    IMAGE,
    INVERT,
    bag,
    converter,
    image_accelerator,
    values,
)
from tests.system.systems import LIBRARIES

SEED = seeded(20240921)
# Of clk and of another clock; no edge of one has a fixed place in the other's period (firm_sim_clock).
CLOCKS = [("100 MHz", "11 MHz"), ("100 MHz", "97 MHz"), ("50 MHz", "333.3 MHz")]
SAME = "the system's"
TWICE = INVERT.replace("inverted)]", 'inverted), ("copy", inverted)]')


def system(
    folder: Path,
    stimuli: Path,
    model: str,
    project: dict[str, Any],
    accelerators: Sequence[Any],
    blocks: Sequence[Any],
) -> GeneratedSystem:
    """The system of a specification, whose accelerators' sources lie in `folder`."""
    spec = folder / "system.yaml"
    content = {"project": {"name": "domains", **project}, "accelerators": accelerators, "blocks": blocks}
    spec.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    (folder / "model.py").write_text(model, encoding="utf-8")
    return build(call(spec, stimuli, folder / "model.py"), folder / "work")


def project(width: int, own: str, **others: str) -> dict[str, Any]:
    """A project with further clocks by name."""
    clocks = [{"name": name, "frequency": frequency} for name, frequency in others.items()]
    return {"width": width, "clock": own, "clocks": clocks or None}


def block(name: str, type_: str, *outgoing: str, clock: str | None = None) -> dict[str, Any]:
    return {"name": name, "type": type_, "clock": clock, "outgoing": [{"name": other} for other in outgoing]}


def check(made: GeneratedSystem, *stalls: int) -> None:
    for percent in stalls:
        assert made.passes(SEED=SEED + percent, STALL_PERCENT=percent, WATCHDOG=10000)


def entities(made: GeneratedSystem, name: str) -> int:
    """How many instances of an entity of the library the top level has."""
    text = (made.folder / f"{made.entity}.vhd").read_text(encoding="utf-8")
    return len(re.findall(rf": entity firm\.{name}\b", text))


# --- messages of fixed size ----------------------------------------------------------------------------------------


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("own", "other"), CLOCKS)
def test_parts_of_messages_meet_from_several_domains(tmp_path: Path, own: str, other: str) -> None:
    """Of fixed size, there and back; a publisher gets fields from two domains, an accelerator from two subscribers."""
    shutil.copy(DATA / "swap.vhd", tmp_path)
    content = yaml.safe_load((DATA / "parts.yaml").read_text(encoding="utf-8"))
    for item in content["blocks"]:
        if item.get("type"):
            item["clock"] = {"first": "fast", "second": "slow"}[item["name"]]
    # In turn: what waits for another message holds up those behind it.
    messages = "".join(
        f"- {('pose_sub', 'part_sub', 'other_sub')[n % 3]}: "
        f"{{position: {{x: {n}, y: {n + 0.5}, z: -{n}}}, orientation: {{x: 1, y: {n}, z: 2, w: {n}}}}}\n"
        for n in range(30)
    )
    (tmp_path / "stimuli.yaml").write_text(messages, encoding="utf-8")
    made = system(
        tmp_path,
        tmp_path / "stimuli.yaml",
        (DATA / "parts_model.py").read_text(encoding="utf-8"),
        project(8, own, fast=other, slow="7 MHz"),
        content["accelerators"],
        content["blocks"],
    )
    assert entities(made, "firm_cdc_message") == 5
    check(made, 0, 50)


# --- messages of variable size -------------------------------------------------------------------------------------


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize(("own", "other"), [(SAME, SAME), *CLOCKS])
@pytest.mark.parametrize(("width", "other_width"), [(8, 64), (64, 8), (32, 32), (128, 512)])
def test_an_image_streams_through(tmp_path: Path, own: str, other: str, width: int, other_width: int) -> None:
    shutil.copy(DATA / "invert.vhd", tmp_path)
    is_clocked = own != SAME
    blocks = [
        converter("sub", "subscriber", IMAGE, "acc"),
        block("acc", "invert", "pub", clock="camera" if is_clocked else None),
        converter("pub", "publisher", IMAGE),
    ]
    stimuli = bag(tmp_path, IMAGE, values(IMAGE, 10))
    made = system(
        tmp_path,
        stimuli,
        INVERT,
        project(width, own, camera=other) if is_clocked else project(width, "1 MHz"),
        [{**image_accelerator(length="given"), "width": other_width}],
        blocks,
    )
    assert entities(made, "firm_cdc_stream") == (6 if is_clocked else 0)
    assert entities(made, "firm_axis_resize") == (0 if is_clocked or width == other_width else 6)
    check(made, 0, 60)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("width", [8, 64])
def test_an_image_goes_to_several_domains(tmp_path: Path, width: int) -> None:
    """A fork with sinks in two domains; behind it two accelerators of one domain and of two widths."""
    source = (DATA / "invert.vhd").read_text(encoding="ascii")
    (tmp_path / "invert.vhd").write_text(source, encoding="ascii")
    (tmp_path / "invert_wide.vhd").write_text(re.sub(r"\binvert\b", "invert_wide", source), encoding="ascii")
    narrow = image_accelerator(length="given")
    wide = {**narrow, "name": "invert_wide", "sources": "invert_wide.vhd", "width": 128}
    blocks = [
        converter("sub", "subscriber", IMAGE, "acc", "copy"),
        block("acc", "invert", "pub", "again", clock="fast"),
        block("again", "invert_wide", "twice", clock="fast"),
        *(converter(name, "publisher", IMAGE, buffer=500) for name in ("pub", "copy", "twice")),
    ]
    stimuli = bag(tmp_path, IMAGE, values(IMAGE, 8))
    made = system(tmp_path, stimuli, ALL, project(width, "100 MHz", fast="273 MHz"), [narrow, wide], blocks)
    # In, to two publishers, and none between the two accelerators.
    assert entities(made, "firm_cdc_message") == 3
    assert entities(made, "firm_axis_resize") == 3
    check(made, 0, 60)


@pytest.mark.check
@pytest.mark.parametrize("width", [8, pytest.param(16, marks=pytest.mark.thorough)])
def test_every_path_between_the_clocks_of_a_system_is_synchronised(tmp_path: Path, width: int) -> None:
    """The top level with all that it holds, as a netlist; that does the same, too."""
    shutil.copy(DATA / "invert.vhd", tmp_path)
    blocks = [
        converter("sub", "subscriber", IMAGE, "acc", "other"),
        block("acc", "invert", "pub", clock="fast"),
        block("other", "invert", "copy", clock="slow"),
        *(converter(name, "publisher", IMAGE, buffer=500) for name in ("pub", "copy")),
    ]
    stimuli = bag(tmp_path, IMAGE, values(IMAGE, 4))
    clocks = project(8, "100 MHz", fast="270 MHz", slow="31 MHz")
    accelerator = {**image_accelerator(length="given"), "width": width}
    made = system(tmp_path, stimuli, TWICE, clocks, [accelerator], blocks)
    check(made, 20)
    # What synthesis has in place of the synchronisers of simulation.
    Library("firm", made.folder).analyse(core_files("cdc/sync", "cdc/cdc"))
    made.work.analyse(made.folder / f"{made.entity}{end}.vhd" for end in ("", "_tb"))
    assert made.work.latches(made.entity) == []
    sides = {"clk": "clk", "clk_fast": "fast", "clk_slow": "slow"}
    domains = Domains(sides, lambda port: "clk", held=("fields_r",))
    verilog = made.work.synthesise(made.entity, language="verilog")
    assert unsynchronised(verilog, made.entity, tmp_path, domains) == []
    # It sees all of them: with the fields there is something.
    assert unsynchronised(verilog, made.entity, tmp_path, replace(domains, held=()))
    if width == 8:
        made.replace_by_netlist()
        check(made, 20)


def pass_through(folder: Path, name: str, message: str, width: int) -> dict[str, Any]:
    """An accelerator that wires a message of any kind through: its source is in `folder`."""
    side = {"middleware": "ROS2", "message": message}
    interface = {"input": [side], "output": [{**side, "length": "given"}]}
    accelerator = {"name": name, "type": "VHDL", "sources": f"{name}.vhd", "interface": interface, "width": width}
    blocks = [
        converter("sub", "subscriber", message, "acc"),
        block("acc", name, "pub"),
        converter("pub", "publisher", message, buffer=100),
    ]
    spec = folder / "probe.yaml"
    content = {"project": {"name": "probe"}, "accelerators": [accelerator], "blocks": blocks}
    spec.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    (type_,) = load_system(spec, LIBRARIES, needs_sources=False).system.accelerator_types
    declared, wired = [], []
    for prefix, port in accelerator_ports(type_):
        kind = "std_logic" if port.width is None else f"std_logic_vector({port.width - 1} downto 0)"
        declared.append(f"    {prefix}{port.name} : {'out' if port.is_output else 'in'} {kind}")
        if port.is_output:
            other = {"in_": "out_", "out_": "in_"}[prefix]
            wired.append(f"  {prefix}{port.name} <= {other}{port.name};")
    ports = ";\n".join(["    clk : in std_logic", "    rst_n : in std_logic", *declared])
    text = f"library ieee;\nuse ieee.std_logic_1164.all;\nentity {name} is\n  port (\n{ports});\nend entity {name};\n"
    wires = "\n".join(wired)
    text += f"architecture rtl of {name} is\nbegin\n{wires}\nend architecture rtl;\n"
    (folder / f"{name}.vhd").write_text(text, encoding="ascii")
    return accelerator


# Elements with fields only, with a string each, with strings and elements of their own, and arrays of all kinds.
ELEMENTS = (
    "geometry_msgs/PolygonStamped",
    "sensor_msgs/PointCloud2",
    "diagnostic_msgs/DiagnosticArray",
    "trajectory_msgs/JointTrajectory",
    "rcl_interfaces/ParameterEvent",
)


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(("width", "other_width", "own", "other"), [(8, 32, *CLOCKS[0]), (64, 16, *CLOCKS[2])])
@pytest.mark.parametrize("message", ELEMENTS)
def test_elements_go_through(tmp_path: Path, message: str, width: int, other_width: int, own: str, other: str) -> None:
    accelerator = pass_through(tmp_path, "way", message, other_width)
    blocks = [
        converter("sub", "subscriber", message, "left", "middle", "right"),
        block("left", "way", "left_pub", clock="other"),
        converter("left_pub", "publisher", message, buffer=4000),
        *(converter(name, "publisher", message, buffer=4000) for name in ("middle", "right")),
    ]
    stimuli = bag(tmp_path, message, values(message, 6, longest=5))
    model = COPIES.replace('"left"', '"left_pub"')
    made = system(tmp_path, stimuli, model, project(width, own, other=other), [accelerator], blocks)
    check(made, 0, 50)


# --- an application ------------------------------------------------------------------------------------------------


@pytest.mark.check
@pytest.mark.parametrize(
    ("width", "other_width", "own", "other"), [(8, 64, "100 MHz", "31 MHz"), (64, 16, "50 MHz", "333 MHz")]
)
def test_edges_at_another_clock_and_width(tmp_path: Path, width: int, other_width: int, own: str, other: str) -> None:
    """The Sobel filter as it stands in specs/: the same pixels, also behind frames that break off."""
    source = random.Random(SEED + width)
    print(f"seed {SEED + width}")
    copy = copied(tmp_path, "sobel", width)
    spec = copy / "sobel.yaml"
    content = yaml.safe_load(spec.read_text(encoding="utf-8"))
    content["project"] |= project(width, own, camera=other)
    content["accelerators"][0]["width"] = other_width
    content["blocks"][1]["clock"] = "camera"
    spec.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    messages: list[Message] = [*odd_images("ROS", source, 1), *random_images("ROS", source, 1, 10)]
    messages.append(image("ROS", source, 30, 200, 1))
    source.shuffle(messages)
    made = fed(copy, [("camera", message) for message in messages])
    check(made, 0, 50)
    break_off(made, source)
    check(made, 0, 50)


def break_off(made: GeneratedSystem, source: random.Random) -> None:
    """Cut every third frame in the lengths of its message: the filter has seen a header, and must take it back."""
    stimuli, answers = (made.folder / f"{file}.txt" for file in ("stimulus", "expected"))
    frames, expected = (
        re.split(r"^[<>] .*\n", file.read_text(encoding="ascii"), flags=re.MULTILINE)[1:] for file in (stimuli, answers)
    )
    sent, wanted, errors = "", "", 0
    for number, (frame, answer) in enumerate(zip(frames, expected, strict=True)):
        data = bytes.fromhex(frame)
        if number % 3 == 0:
            data, errors = data[: source.randrange(6, 5 + 12 + 4)], errors + 1
        else:
            wanted += f"< @{number} {number}\n{answer}"
        sent += f"> {number}\n  {data.hex()}\n"
    stimuli.write_text(sent, encoding="ascii")
    answers.write_text(f"! frame_error {errors}\n{wanted}", encoding="ascii")
