"""Accelerators for some fields of a message, whose other fields pass by: slow ones, broken frames, all languages."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from tests.applications.images import break_frames, image, yaml_of
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

SEED = seeded(20241123)
# It takes its fields at once and answers later, with the height and the width exchanged.
SLOW = """\
library ieee;
use ieee.std_logic_1164.all;

entity exchange is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;
    in_height         : in  std_logic_vector(31 downto 0);
    in_width          : in  std_logic_vector(31 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;
    out_height        : out std_logic_vector(31 downto 0);
    out_width         : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic;
    led               : out std_logic
  );
end entity;

architecture rtl of exchange is
  signal left_r   : natural range 0 to 400 := 0;
  signal answer_r : std_logic := '0';
begin
  led                  <= answer_r;
  in_msg_ready         <= '1' when left_r = 0 and answer_r = '0' else '0';
  out_segment_valid(0) <= answer_r;
  work : process (clk)
  begin
    if rising_edge(clk) then
      if answer_r = '1' then
        answer_r <= not out_msg_ready;
      elsif left_r > 0 then
        left_r <= left_r - 1;
        if left_r = 1 then
          answer_r <= '1';
        end if;
      elsif in_msg_valid = '1' then
        left_r     <= CYCLES;
        out_height <= in_width;
        out_width  <= in_height;
      end if;
      if rst_n = '0' then
        left_r   <= 0;
        answer_r <= '0';
      end if;
    end if;
  end process;
end architecture;
"""
MODEL = """\
def respond(_, message):
    return [("pub", {**message, "height": message["width"], "width": message["height"]})]
"""


def exchanged(folder: Path, messages: list[dict[str, Any]], width: int, cycles: int) -> GeneratedSystem:
    side = {"middleware": "ROS", "message": "sensor_msgs/Image", "include": ["height", "width"]}
    converter = {"middleware": "ROS", "message": "sensor_msgs/Image"}
    accelerator = {
        "name": "exchange",
        "type": "VHDL",
        "sources": "exchange.vhd",
        "interface": {"input": [side], "output": [{**side, "others": "pass"}]},
        "pins": [{"name": "led", "direction": "out"}],
    }
    blocks = [
        {"name": "sub", "mode": "subscriber", **converter, "outgoing": [{"name": "acc"}]},
        {"name": "acc", "type": "exchange", "outgoing": [{"name": "pub"}]},
        {"name": "pub", "mode": "publisher", **converter},
    ]
    system = {"project": {"name": "swap", "width": width}, "accelerators": [accelerator], "blocks": blocks}
    (folder / "swap.yaml").write_text(yaml.safe_dump(system, sort_keys=False), encoding="utf-8")
    (folder / "exchange.vhd").write_text(SLOW.replace("CYCLES", str(cycles)), encoding="ascii")
    (folder / "model.py").write_text(MODEL, encoding="ascii")
    stimuli = "".join(f"- sub: {yaml_of(message)}\n" for message in messages)
    (folder / "stimuli.yaml").write_text(stimuli, encoding="utf-8")
    request = call(folder / "swap.yaml", folder / "stimuli.yaml", folder / "model.py")
    return build(request, folder / "work")


@pytest.mark.one_in(3)
@pytest.mark.parametrize("cycles", [1, 30, 400])
@pytest.mark.parametrize("width", [8, 64])
def test_a_slow_accelerator_and_broken_frames(tmp_path: Path, width: int, cycles: int) -> None:
    """Its answers to withdrawn messages are dropped."""
    print(f"seed {SEED + width}")
    source = random.Random(SEED + width)
    messages = [image("ROS", source, 30, 50, 1, frame_id="f" * source.randrange(9)) for _ in range(6)]
    made = exchanged(tmp_path, messages, width, cycles)
    assert made.work.latches("exchange_bypass", {}) == []
    assert made.passes(SEED=SEED, STALL_PERCENT=30)
    break_frames(made, source, 30 * 50, width // 8, in_header=False)
    for stalls in (0, 40):
        assert made.passes(SEED=SEED, STALL_PERCENT=stalls)


@pytest.mark.one_in(5)
@pytest.mark.parametrize(
    ("message", "field", "language"),
    [
        ("geometry_msgs/PoseStamped", "pose.orientation", "vhdl"),
        ("sensor_msgs/Imu", "angular_velocity_covariance", "hls"),
        ("geometry_msgs/Pose", "position.z", "vhdl"),
        ("geometry_msgs/Pose", "position.z", "hls"),
        ("nav_msgs/Odometry", "twist.twist.linear.x", "vhdl"),
        ("sensor_msgs/JointState", "header.stamp", "hls"),
        ("nav_msgs/Path", "header.stamp.sec", "vhdl"),
        ("sensor_msgs/CameraInfo", "roi.do_rectify", "vhdl"),
        # Its last segment precedes the data.
        ("sensor_msgs/Image", "step", "vhdl"),
        ("sensor_msgs/Image", "is_bigendian", "hls"),
    ],
)
def test_a_new_project_for_a_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, message: str, field: str, language: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "part", "--in", message, "--include", field, "--language", language]) == 0
    folder = tmp_path / "part"
    request = call(folder / "part.yaml", folder / "stimuli.yaml", folder / "model.py")
    assert build(request, tmp_path / "work").passes(SEED=SEED, STALL_PERCENT=50)


@pytest.mark.parametrize(
    ("messages", "fields", "language"),
    [
        (("sensor_msgs/Imu", "geometry_msgs/Vector3Stamped"), ("header", "angular_velocity.z"), "vhdl"),
        (("geometry_msgs/PoseStamped", "geometry_msgs/PointStamped"), ("pose.position",), "hls"),
        (("sensor_msgs/JointState", "trajectory_msgs/JointTrajectoryPoint"), ("name", "velocity"), "vhdl"),
        (("geometry_msgs/Pose", "geometry_msgs/Vector3"), ("position",), "vhdl"),
    ],
)
def test_a_new_project_that_receives_a_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, messages: tuple[str, str], fields: tuple[str, ...], language: str
) -> None:
    monkeypatch.chdir(tmp_path)
    included = [word for field in fields for word in ("--include", field)]
    options = ["--in", messages[0], "--out", messages[1], *included, "--language", language]
    assert main(["init", "part", *options]) == 0
    folder = tmp_path / "part"
    specification = yaml.safe_load((folder / "part.yaml").read_text(encoding="utf-8"))
    interface = specification["accelerators"][0]["interface"]
    assert interface["input"][0]["include"] == [*fields]
    assert not {"include", "others"} & interface["output"][0].keys()
    request = call(folder / "part.yaml", folder / "stimuli.yaml", folder / "model.py")
    assert build(request, tmp_path / "work").passes(SEED=SEED, STALL_PERCENT=50)


def test_a_part_of_an_unknown_field_or_in_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    options = ["--in", "geometry_msgs/Pose", "--include", "position.z"]
    assert main(["init", "part", *options, "--language", "software"]) == 1
    assert "an accelerator in software receives whole messages" in capsys.readouterr().err
    assert main(["init", "part", *options[:2], "--include", "position.t"]) == 1
    assert "geometry_msgs/Pose has no field 'position.t'" in capsys.readouterr().err
