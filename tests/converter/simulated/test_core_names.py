"""Converters of one message for both versions of ROS and two widths, side by side by the parameter `name`.

Each publisher's frame goes to the subscriber of the same core. The files of one core are listed twice, as two cores
with equal parameters bring them.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.core.request import GeneratorCall
from tests.hdl.ghdl import REPOSITORY, core_files

MESSAGE = "geometry_msgs/Point"
# Name, version of ROS, width.
CORES = [("", 2, 8), ("left", 1, 8), ("right", 2, 32)]

DESIGN = """\
library ieee;
use ieee.std_logic_1164.all;

entity variants is
  port (
    clk, rst_n : in  std_logic;
    value      : in  std_logic_vector(63 downto 0);
    is_equal   : out std_logic_vector(2 downto 0)
  );
end entity;

architecture rtl of variants is
{signals}begin
{instances}end architecture;
"""
SIGNALS = """\
  signal data_{n}                     : std_logic_vector({width} - 1 downto 0);
  signal keep_{n}                     : std_logic_vector({width} / 8 - 1 downto 0);
  signal valid_{n}, last_{n}, ready_{n} : std_logic;
  signal sub_valid_{n}, sub_ready_{n}   : std_logic;
  signal is_first_{n}, msg_valid_{n}    : std_logic;
  signal x_{n}, y_{n}, z_{n}          : std_logic_vector(63 downto 0);
"""
# As the Manager does: at 8 bits the id's beat is kept back, at others its lane is void.
INSTANCES = """\
  publisher_{n} : entity work.{prefix}geometry_msgs_point_to_axis
    generic map (ID => 7)
    port map (clk => clk, rst_n => rst_n, x => value, y => (others => '0'), z => value, segment_valid => "1",
              msg_ready => open, m_axis_tdata => data_{n}, m_axis_tkeep => keep_{n}, m_axis_tvalid => valid_{n},
              m_axis_tlast => last_{n}, m_axis_tready => ready_{n});
  subscriber_{n} : entity work.{prefix}axis_to_geometry_msgs_point
    port map (clk => clk, rst_n => rst_n, x => x_{n}, y => y_{n}, z => z_{n}, segment_valid => open,
              msg_valid => msg_valid_{n}, msg_ready => '1', frame_error => open, frame_error_code => open,
              s_axis_tdata => data_{n}, s_axis_tkeep => keep_{n}, s_axis_tvalid => sub_valid_{n},
              s_axis_tlast => last_{n}, s_axis_tready => sub_ready_{n});
  sub_valid_{n} <= valid_{n} and not ({is_byte} and is_first_{n});
  ready_{n}     <= sub_ready_{n} or ({is_byte} and is_first_{n});
  count_{n} : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        is_first_{n} <= '1';
        is_equal({n}) <= '0';
      else
        if valid_{n} = '1' and ready_{n} = '1' then
          is_first_{n} <= last_{n};
        end if;
        if msg_valid_{n} = '1' then
          is_equal({n}) <= '0';
          if x_{n} = value and z_{n} = value and y_{n} = x"0000000000000000" then
            is_equal({n}) <= '1';
          end if;
        end if;
      end if;
    end if;
  end process;
"""
BENCH_VHDL = """\
library ieee;
use ieee.std_logic_1164.all;

entity bench is
end entity;

architecture sim of bench is
  signal clk, rst_n : std_logic := '0';
  signal is_equal   : std_logic_vector(2 downto 0);
begin
  dut : entity work.variants port map (clk, rst_n, x"400921fb54442d18", is_equal);
  process
  begin
    assert work.left_geometry_msgs_point_pkg.SIGNATURE'length = 32;
    assert work.right_geometry_msgs_point_pkg.SIGNATURE = work.geometry_msgs_point_pkg.SIGNATURE severity failure;
    for beat in 1 to 200 loop
      clk <= '0', '1' after 5 ns;
      wait for 10 ns;
      rst_n <= '1';
    end loop;
    assert is_equal = "111" severity failure;
    report "PASS";
    wait;
  end process;
end architecture;
"""
BENCH = """\
module bench;
  reg clk = 0, rst_n = 0;
  wire [2:0] is_equal;
  variants dut (.clk(clk), .rst_n(rst_n), .value(64'h400921fb54442d18), .is_equal(is_equal));
  initial begin
    repeat (200) begin
      #5 clk = 1;
      #5 clk = 0;
      rst_n = 1;
    end
    if (is_equal === 3'b111) $display("PASS");
    else $fatal;
  end
endmodule
"""
FLOW = """
import json
from pathlib import Path
from edalize.flows.sim import Sim
flow = Sim(json.loads(Path("edam.json").read_text()), Path("."))
flow.configure()
flow.build()
flow.run()
"""


def generated(name: str, ros: int, width: int) -> dict[str, str]:
    """The files of a core."""
    given: dict[str, Any] = {"message": MESSAGE, "ros": ros, "width": width} | ({"name": name} if name else {})
    call = GeneratorCall("firm", "me:p:top-a:1.0", "/nowhere", given)
    request = make_request(call, GENERATORS["firm"].parameters, lambda _: ())
    return {path: str(file.content) for path, file in GENERATORS["firm"].load(request).generate().files.items()}


def design() -> str:
    facts = [
        {"n": n, "prefix": f"{name}_" if name else "", "width": width, "is_byte": "'1'" if width == 8 else "'0'"}
        for n, (name, _, width) in enumerate(CORES)
    ]
    signals, instances = ("".join(text.format(**fact) for fact in facts) for text in (SIGNALS, INSTANCES))
    return DESIGN.format(signals=signals, instances=instances)


@pytest.mark.parametrize("tool", ["ghdl", "icarus"])
def test_cores_of_one_message_stand_side_by_side(tmp_path: Path, tool: str) -> None:
    files = [
        {"name": str(path), "file_type": "vhdlSource-93", "logical_name": "firm"}
        for path in core_files("axis/package", "axis/axis")
    ]
    for folder, (name, ros, width) in zip("abcd", [*CORES, CORES[-1]], strict=True):
        (tmp_path / folder).mkdir()
        for path, text in generated(name, ros, width).items():
            (tmp_path / folder / path).write_text(text)
            files.append({"name": f"{folder}/{path}", "file_type": "vhdlSource-93"})
    for path, text in {"variants.vhd": design(), "bench.vhd": BENCH_VHDL, "bench.v": BENCH}.items():
        (tmp_path / path).write_text(text)
    files.append({"name": "variants.vhd", "file_type": "vhdlSource-93"})
    if tool == "ghdl":
        files.append({"name": "bench.vhd", "file_type": "vhdlSource-93"})
        options: dict[str, Any] = {"tool": "ghdl"}
    else:
        files.append({"name": "bench.v", "file_type": "verilogSource-2005"})
        options = {"tool": "icarus", "frontends": ["ghdlsynth"], "ghdlsynth_top": "variants"}
    edam = {"name": "names", "toplevel": "bench", "files": files, "flow_options": options}
    (tmp_path / "edam.json").write_text(json.dumps(edam))
    done = subprocess.run(
        [sys.executable, "-c", FLOW],
        cwd=tmp_path,
        env={"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "PASS" in done.stdout, done.stdout
