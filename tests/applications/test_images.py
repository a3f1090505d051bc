"""The systems for images and of many types: every byte against the models, broken images and frames, netlists."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.written.specification import read_specification
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.applications.images import (
    SPECS,
    Message,
    break_frames,
    broken_images,
    built,
    copied,
    fed,
    header,
    image,
    odd_images,
    random_images,
    replace_by_netlists,
)
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem

SEED = seeded(20240701)
# Each system with the bytes of a pixel that it takes, its accelerators, and its widest image.
CHANNELS = {"image_pipeline": 3, "sobel": 1}
ENTITIES = {"image_pipeline": ("rgb_to_gray", "scale_down", "integral_image"), "sobel": ("sobel",)}
WIDEST = {"image_pipeline": 3 * 2048, "sobel": 2048}
# Nothing may hang: a beat comes sooner than that, whatever the stalls.
WATCHDOG = 3000


def every_image(name: str, ros: str, source: random.Random) -> list[Message]:
    """Good and broken ones, mixed."""
    channels = CHANNELS[name]
    found = odd_images(ros, source, channels) + broken_images(ros, source, channels)
    found += random_images(ros, source, channels, 8)
    source.shuffle(found)
    return found


def check(made: GeneratedSystem, *stalls: int) -> None:
    for seed, percent in enumerate(stalls, SEED):
        assert made.passes(SEED=seed, STALL_PERCENT=percent, WATCHDOG=WATCHDOG)


def to_camera(messages: Sequence[Message]) -> list[tuple[str, Message]]:
    return [("camera", message) for message in messages]


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("ros", ["ROS", "ROS2"])
@pytest.mark.parametrize("name", ["image_pipeline", "sobel", "multi_type"])
def test_one_word_makes_it_a_system_of_ros_2(tmp_path: Path, name: str, ros: str) -> None:
    """The stimuli that the system comes with; ROS 2 has no `seq`, and calls `nsec` otherwise."""
    copy = copied(tmp_path, name, ros=ros)
    stimuli = copy / "stimuli.yaml"
    if ros == "ROS2":
        text = re.sub(r"seq:\s+\d+,", "", stimuli.read_text(encoding="utf-8"))
        stimuli.write_text(text.replace("nsec:", "nanosec:"), encoding="utf-8")
    check(built(copy, stimuli), 0, 60)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", [8, 64, 128])
@pytest.mark.parametrize("name", ["image_pipeline", "sobel"])
def test_images_of_all_kinds(tmp_path: Path, name: str, width: int) -> None:
    source = random.Random(SEED + width)
    print(f"seed {SEED + width}")
    ros = source.choice(("ROS", "ROS2"))
    made = fed(copied(tmp_path, name, width, ros), to_camera(every_image(name, ros, source)))
    check(made, 50)
    for entity in ENTITIES[name]:
        assert made.work.latches(entity, {"WIDTH": width}) == []
    replace_by_netlists(made, ENTITIES[name], width)
    check(made, 0)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", ["image_pipeline", "sobel"])
def test_an_image_that_is_too_wide_becomes_an_empty_one(tmp_path: Path, name: str) -> None:
    source = random.Random(SEED)
    sizes = [(1, WIDEST[name]), (1, WIDEST[name] + 1), (1, 2)]
    messages = [image("ROS", source, *size, CHANNELS[name]) for size in sizes]
    check(fed(copied(tmp_path, name, 128), to_camera(messages)), 0)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("ratios", [((1, 1), (2, 3)), ((5, 7), (1, 1)), ((1, 20), (19, 20))])
def test_other_ratios(tmp_path: Path, ratios: tuple[tuple[int, int], tuple[int, int]]) -> None:
    """So many columns out of so many, and rows."""
    source = random.Random(SEED)
    copy = copied(tmp_path, "image_pipeline", 64)
    rtl, model = copy / "rtl" / "scale_down.vhd", copy / "model.py"
    vhdl, python = rtl.read_text(encoding="ascii"), model.read_text(encoding="utf-8")
    for name, (out, of) in zip(("COLUMNS", "ROWS"), ratios, strict=True):
        vhdl = re.sub(rf"({name}_IN +: integer := )\d+", rf"\g<1>{of}", vhdl)
        vhdl = re.sub(rf"({name}_OUT +: integer := )\d+", rf"\g<1>{out}", vhdl)
        python = re.sub(rf"^{name} = .*", f"{name} = ({out}, {of})", python, flags=re.MULTILINE)
    rtl.write_text(vhdl, encoding="ascii")
    model.write_text(python, encoding="utf-8")
    check(fed(copy, to_camera(random_images("ROS", source, 3, 6, largest=50))), 25)


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("name", "width"), [("image_pipeline", 64), ("sobel", 8)])
def test_an_image_that_breaks_off_does_not_harm_the_next(tmp_path: Path, name: str, width: int) -> None:
    """Frames that end in their header give no image; those that end among the pixels an aborted one."""
    source = random.Random(SEED + width)
    print(f"seed {SEED + width}")
    channels, lanes = CHANNELS[name], width // 8
    messages = [image("ROS", source, 30, 50, channels) for _ in range(6)]
    made = fed(copied(tmp_path, name, width), to_camera(messages))
    break_frames(made, source, 30 * 50 * channels, lanes)
    check(made, 0, 40)


def scan(ros: str, source: random.Random) -> Message:
    lengths = [source.choice((0, 1, 2, 3, source.randrange(100))) for _ in range(2)]
    angles = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
    arrays = [[source.randrange(2**20) / 2**10 for _ in range(length)] for length in lengths]
    numbers = {name: source.randrange(2**20) / 2**10 for name in angles}
    return {"header": header(ros, source, "s" * source.randrange(20)), **numbers} | dict(
        zip(("ranges", "intensities"), arrays, strict=True)
    )


def twist(ros: str, source: random.Random) -> Message:
    parts = {part: {axis: source.uniform(-9, 9) for axis in "xyz"} for part in ("linear", "angular")}
    return {"header": header(ros, source, "t" * source.randrange(20)), "twist": parts}


@pytest.mark.one_in(2)
@pytest.mark.parametrize("width", [8, 128])
def test_many_types_side_by_side(tmp_path: Path, width: int) -> None:
    source = random.Random(SEED + width)
    print(f"seed {SEED + width}")
    ros = source.choice(("ROS", "ROS2"))
    messages = [("twist_in", twist(ros, source)) for _ in range(15)]
    messages += [("scan_in", scan(ros, source)) for _ in range(15)]
    messages += [("image_in", message) for message in random_images(ros, source, 3, 6, largest=12)]
    source.shuffle(messages)
    made = fed(copied(tmp_path, "multi_type", width, ros), messages)
    check(made, 0)
    for entity in ("pass_twist", "pass_scan", "pass_image"):
        assert made.work.latches(entity, {"WIDTH": width}) == []
    replace_by_netlists(made, ("pass_twist", "pass_scan", "pass_image"), width)
    check(made, 50)


@pytest.mark.parametrize(
    ("generics", "text"),
    [
        (
            {"MAX_COLUMNS": 65536},
            "MAX_COLUMNS is 65536; legal: 1 to 65535, as OUT_BYTES, ",
        ),
        ({"MAX_COLUMNS": 40000, "OUT_BYTES": 2}, "MAX_COLUMNS is 40000; legal"),
        ({"FRAME_ID_BYTES": 1}, "FRAME_ID_BYTES is 1; legal: two full beats or more"),
        ({"MAX_COLUMNS": 32768, "COLUMNS_OUT": 2}, "MAX_COLUMNS is 32768; legal: 1 to 32767"),
        ({"COLUMNS_OUT": 3}, "COLUMNS_OUT is 3; legal: 1 to 2*COLUMNS_IN"),
        ({"ROWS_OUT": 0}, "ROWS_OUT is 0; legal: 1 to 2*ROWS_IN"),
    ],
)
def test_illegal_generics(tmp_path: Path, generics: dict[str, int], text: str) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files("axis/package", "axis/axis", "acc/image/image"))
    result = library.run("firm_image_header", generics, options=["--stop-time=1ns"])
    assert result.exit_code != 0
    assert text in result.output


def test_one_word_is_another_policy(tmp_path: Path) -> None:
    spec = copied(tmp_path, "multi_type") / "multi_type.yaml"
    text = spec.read_text(encoding="utf-8")
    for policy in ("fixed_priority_preemptive", "round_robin", "edf_latency"):
        spec.write_text(re.sub(r"scheduler: \w+", f"scheduler: {policy}", text), encoding="utf-8")
        faults = Diagnostics()
        libraries = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
        found = derive(read_specification(spec, spec.name, faults), spec.parent, libraries, faults).scheduling
        assert (found.policy, found.is_preemptive) == (policy, policy != "round_robin")
        assert [times.period for times in found.times] == [1_000_000, 2_500_000, 3_333_333]
        assert [times.deadline for times in found.times] == [1_000_000, 2_500_000, 2_000_000]
        assert found.shortest_run == 32


# Counts what ends on the system's stream to the host, by publisher.
WATCH = """begin

  watch : process
  begin
    wait until rising_edge(clk);
    if {stream}_tvalid = '1' and {stream}_tready = '1' and {stream}_tlast = '1' then
      for publisher in 0 to 2 loop
        if {stream}_tid(1 downto 0) = IDS(publisher) then
          report "end " & integer'image(publisher);
        end if;
      end loop;
    end if;
  end process watch;
"""
IDS = """
  type ids_t is array (natural range 0 to 2) of std_logic_vector(1 downto 0);
  constant IDS : ids_t := ("00", "01", "10");
"""


@pytest.mark.check
def test_twists_interrupt_images(tmp_path: Path) -> None:
    """Each end on the stream to the host is that of a frame, or of a part of one that is interrupted."""
    source = random.Random(SEED)
    messages = [("twist_in", twist("ROS", source)) for _ in range(60)]
    messages += [("image_in", image("ROS", source, 40, 40, 3)) for _ in range(8)]
    messages += [("scan_in", scan("ROS", source)) for _ in range(32)]
    source.shuffle(messages)
    for policy, stream in (("fixed_priority", "from"), ("fixed_priority_preemptive", "burst")):
        copy = copied(tmp_path / policy, "multi_type")
        spec = copy / "multi_type.yaml"
        text = re.sub(r"scheduler: \w+", f"scheduler: {policy}", spec.read_text(encoding="utf-8"))
        spec.write_text(text, encoding="utf-8")
        made = fed(copy, messages)
        bench = made.folder / f"{made.entity}_tb.vhd"
        top = bench.read_text(encoding="ascii").replace("\nbegin\n", f"{IDS}\n{WATCH.format(stream=stream)}", 1)
        bench.write_text(top, encoding="ascii")
        made.work.analyse([bench])
        result = made.run(STALL_PERCENT=0)
        assert result.exit_code == 0
        twists, scans, images = (result.output.count(f"end {publisher}") for publisher in range(3))
        print(f"{policy}: {twists} {scans} {images}")
        if policy == "fixed_priority":
            assert (twists, scans, images) == (60, 32, 8)
        else:
            # Twists and scans pass through, so they pause at times, and whoever pauses is interrupted as well.
            assert twists >= 60 and scans >= 32 and images > 2 * 8


def test_the_systems_are_those_of_the_folder() -> None:
    assert {*ENTITIES, "multi_type"} <= {folder.name for folder in SPECS.iterdir()}
