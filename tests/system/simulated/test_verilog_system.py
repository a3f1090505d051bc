"""Systems with accelerators in Verilog and SystemVerilog: the same messages as the model's, whatever stalls."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.text.diagnostics import InputError
from tests.hdl.verilog import Icarus, build, compile_verilog, translated
from tests.system.simulated import systems
from tests.system.simulated.first_versions import BOARD, IMAGE_STIMULUS, ZEROS, write_messages

pytestmark = pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")

POINT, POSE, IMAGE = "geometry_msgs/Point", "geometry_msgs/Pose", "sensor_msgs/Image"
FIRST = f"""
project: {{name: first}}
accelerators:
  - name: Mix
    type: Verilog
    sources: rtl/mix.v
    interface:
      input: [{{middleware: ROS, message: {IMAGE}}}, {{middleware: ROS, message: {POINT}}}]
      output:
        - {{middleware: ROS, message: {IMAGE}, length: given}}
        - {{middleware: ROS, message: {POSE}}}
        - {{middleware: ROS, message: {BOARD}, length: given}}
    pins: [{{name: done, direction: out}}, {{name: switches, direction: in, bits: 4}}]
  - name: Listen
    type: Verilog
    sources: rtl/listen.v
    interface:
      output: [{{middleware: ROS, message: {POINT}}}]
blocks:
  - {{name: image, middleware: ROS, mode: subscriber, message: {IMAGE}, outgoing: [{{name: m}}]}}
  - {{name: point, middleware: ROS, mode: subscriber, message: {POINT}, outgoing: [{{name: m}}]}}
  - {{name: m, type: Mix, outgoing: [{{name: image_out}}, {{name: pose_out}}, {{name: board}}]}}
  - {{name: l, type: Listen, outgoing: [{{name: heard}}]}}
  - {{name: image_out, middleware: ROS, mode: publisher, message: {IMAGE}}}
  - {{name: pose_out, middleware: ROS, mode: publisher, message: {POSE}}}
  - {{name: board, middleware: ROS, mode: publisher, message: {BOARD}}}
  - {{name: heard, middleware: ROS, mode: publisher, message: {POINT}}}
"""
FIRST_STIMULI = (
    IMAGE_STIMULUS
    + """\
- point: {x: 1.0, y: 2.0, z: 3.0}
"""
)
FIRST_MODEL = (
    ZEROS
    + """


def respond(subscriber, message):
    return {"image": [], "point": [("image_out", FIELDS), ("pose_out", POSE), ("board", BOARD)]}[subscriber]
"""
)

# x and y change places in a module of SystemVerilog; what z becomes, a module of Verilog says with an included file.
# The pins say whether the environment answers.
SWAP = f"""
project: {{name: swap, width: 64}}
accelerators:
  - name: swap
    type: Verilog
    sources: [rtl/swap.sv, rtl/negate.v, rtl/sign.vh]
    interface:
      input: [{{middleware: ROS, message: {POINT}}}]
      output: [{{middleware: ROS, message: {POINT}}}]
    pins: [{{name: ask, direction: out}}, {{name: answer, direction: in, bits: 2}}]
  - name: pass
    type: VHDL
    sources: rtl/pass.vhd
    interface:
      input: [{{middleware: ROS, message: {POINT}}}]
      output: [{{middleware: ROS, message: {POINT}}}]
blocks:
  - {{name: a, middleware: ROS, mode: subscriber, message: {POINT}, outgoing: [{{name: s}}]}}
  - {{name: s, type: swap, outgoing: [{{name: p}}]}}
  - {{name: p, type: pass, outgoing: [{{name: b}}]}}
  - {{name: b, middleware: ROS, mode: publisher, message: {POINT}}}
"""
SOURCES = {
    "rtl/sign.vh": "`define SIGN 63\n",
    "rtl/negate.v": """
`include "sign.vh"
module negate (input [63:0] value, output [63:0] result);
  assign result = {~value[`SIGN], value[`SIGN-1:0]};
endmodule
""",
    "rtl/swap.sv": """
module swap #(parameter int WIDTH = 8) (
  input  logic        clk, rst_n,
  input  logic [63:0] in_x, in_y, in_z,
  input  logic [0:0]  in_segment_valid,
  input  logic        in_msg_valid,
  output logic        in_msg_ready,
  output logic [63:0] out_x, out_y, out_z,
  output logic [0:0]  out_segment_valid,
  input  logic        out_msg_ready,
  output logic        ask,
  input  logic [1:0]  answer
);
  logic        is_full;
  logic [63:0] negated;
  negate u_negate (.value(in_z), .result(negated));
  assign in_msg_ready = in_msg_valid && !is_full;
  assign out_segment_valid = is_full;
  assign ask = is_full;
  always @(posedge clk)
    if (!rst_n)
      is_full <= 0;
    else if (in_msg_ready) begin
      is_full <= 1;
      out_x   <= in_y;
      // The streams' width is told, or x stays what it was.
      out_y   <= WIDTH == 64 ? in_x : 0;
      out_z   <= answer == 2 ? negated : in_z;
    end else if (out_msg_ready)
      is_full <= 0;
endmodule
""",
    "rtl/pass.vhd": """
library ieee;
use ieee.std_logic_1164.all;
entity pass is
  port (
    clk, rst_n : in std_logic;
    in_x, in_y, in_z : in std_logic_vector(63 downto 0);
    in_segment_valid : in std_logic_vector(0 downto 0);
    in_msg_valid : in std_logic;
    in_msg_ready : out std_logic;
    out_x, out_y, out_z : out std_logic_vector(63 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready : in std_logic);
end entity;
architecture rtl of pass is
begin
  out_x <= in_x;
  out_y <= in_y;
  out_z <= in_z;
  out_segment_valid(0) <= in_msg_valid;
  in_msg_ready <= out_msg_ready;
end architecture;
""",
    # It answers 2 from when it was asked, with the first message, which leaves with z as it came.
    "tb/around.vhd": """
library ieee;
use ieee.std_logic_1164.all;
entity around is
  port (clk, rst_n : in std_logic; s_ask : in std_logic; s_answer : out std_logic_vector(1 downto 0));
end entity;
architecture behaviour of around is
  signal asked_r : std_logic;
begin
  listen : process (clk)
  begin
    if rising_edge(clk) then
      asked_r <= rst_n and (asked_r or s_ask);
    end if;
  end process listen;
  s_answer <= asked_r & '0';
end architecture;
""",
}
SWAP_STIMULI = "".join(f"- a: {{x: {n}.5, y: -{n}.25, z: {n}.125}}\n" for n in range(1, 30))
SWAP_MODEL = """
asked = False


def respond(subscriber, message):
    global asked
    z = -message["z"] if asked else message["z"]
    asked = {asks}
    return [("b", {{"x": message["y"], "y": message["x"], "z": z}})]
"""


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def compiled(folder: Path, **parameters: list[str]) -> Icarus:
    return build(systems.call(folder / "spec.yaml", folder / "stimuli.yaml", folder / "model.py", **parameters), folder)


def passes(made: Icarus, folder: Path, messages: int, **options: int) -> bool:
    result = made.run(folder, SHOWN=1, **options)
    print(result.output)
    return result.exit_code == 0 and f"PASS {messages}/{messages}" in result.output.splitlines()


def test_a_first_version_copies_fields(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, {"spec.yaml": FIRST, "stimuli.yaml": FIRST_STIMULI * 5, "model.py": FIRST_MODEL})
    command = ["system", "skeleton", str(tmp_path / "spec.yaml"), "--path", str(write_messages(tmp_path))]
    assert main(command) == 0
    source = tmp_path / "rtl" / "mix.v"
    assert capsys.readouterr().out == f"{source}\n{source.with_name('listen.v')}\n"
    made = compiled(tmp_path, paths=["demo_msgs"])
    assert passes(made, tmp_path, 15, STALL_PERCENT=0)
    assert passes(made, tmp_path, 15, SEED=3, STALL_PERCENT=60)
    # It is its author's from now on.
    source.write_text("mine")
    assert main(command) == 0
    assert source.read_text() == "mine"


@pytest.mark.parametrize("environment", [True, False])
def test_verilog_and_vhdl_work_together(tmp_path: Path, environment: bool) -> None:
    model = SWAP_MODEL.format(asks=environment)
    write(tmp_path, {**SOURCES, "spec.yaml": SWAP, "stimuli.yaml": SWAP_STIMULI, "model.py": model})
    made = compiled(tmp_path, **({"environment": ["tb/around.vhd"]} if environment else {}))
    for seed, stall_percent in ((1, 0), (2, 30), (3, 80)):
        assert passes(made, tmp_path, 29, SEED=seed, STALL_PERCENT=stall_percent)


def test_a_broken_stream_is_found(tmp_path: Path) -> None:
    """Between system and host, and of a publisher within the system."""
    write(tmp_path, {**SOURCES, "spec.yaml": SWAP, "stimuli.yaml": SWAP_STIMULI})
    (tmp_path / "model.py").write_text(SWAP_MODEL.format(asks=False), encoding="utf-8")
    call = systems.call(tmp_path / "spec.yaml", tmp_path / "stimuli.yaml", tmp_path / "model.py")
    top, files = translated(call, tmp_path)
    (bench,) = (path for path in files if path.stem == top)
    text = bench.read_text(encoding="utf-8")
    # tvalid is low in every second cycle.
    odd = "  reg odd = 0;\n  always @(posedge clk) odd <= !odd;\n"
    outer = text.replace(".m_axis_tvalid(from_tvalid)", ".m_axis_tvalid(sent_tvalid)").replace(
        "  wire from_tvalid;\n", f"  wire sent_tvalid;\n{odd}  wire from_tvalid = sent_tvalid && odd;\n"
    )
    inner = text.replace("= u_system.pub_axis_tvalid;", "= u_system.pub_axis_tvalid && odd;").replace(
        "  wire from_tvalid;\n", f"{odd}  wire from_tvalid;\n"
    )
    for stream, broken in (("to the host", outer), ("from a publisher", inner)):
        assert broken.count("&& odd;") == 1
        bench.write_text(broken, encoding="utf-8")
        done = compile_verilog(top, files, tmp_path).run(tmp_path, SEED=2, STALL_PERCENT=50)
        assert done.exit_code
        assert f"firm_axis_checker: {stream}: stable: tvalid fell before tready" in done.output


def test_ghdl_is_not_asked_for_verilog(tmp_path: Path) -> None:
    model = SWAP_MODEL.format(asks=False)
    write(tmp_path, {**SOURCES, "spec.yaml": SWAP, "stimuli.yaml": SWAP_STIMULI, "model.py": model})
    request = systems.call(tmp_path / "spec.yaml", tmp_path / "stimuli.yaml", tmp_path / "model.py")
    with pytest.raises(InputError, match="GHDL cannot simulate Verilog, the language of 'swap'"):
        systems.build(request, tmp_path / "build")
