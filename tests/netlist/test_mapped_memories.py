"""Parts whose memories are declared free of collisions: mapped to block RAM, they do what their netlist does."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

SEED = seeded(20261130)
CYCLES = 4_000
WIDTH = 16

needs_tools = pytest.mark.skipif(not all(map(shutil.which, ("yosys", "iverilog"))), reason="no yosys or iverilog")

# Random frames, stalls on both sides, and both parts side by side; outputs are compared while they are valid.
_BENCH = """
module bench;
  reg clk = 0, rst_n = 0, tvalid = 0, tlast = 0, tuser = 0, tready = 0;
  reg [15:0] tdata = 0;
  integer seed = {seed}, beats = 0, cycle;
  wire [3:0] ready, valid;
  wire [19:0] out [0:1];
  part of_source (.clk(clk), .rst_n(rst_n), .s_axis_tdata(tdata), .s_axis_tkeep(2'b11), .s_axis_tuser(tuser),
    .s_axis_tvalid(tvalid), .s_axis_tlast(tlast), .s_axis_tready(ready[0]), .m_axis_tdata(out[0][15:0]),
    .m_axis_tkeep(out[0][17:16]), .m_axis_tuser(out[0][18]), .m_axis_tvalid(valid[0]), .m_axis_tlast(out[0][19]),
    .m_axis_tready(tready){rest});
  mapped of_cells (.clk(clk), .rst_n(rst_n), .s_axis_tdata(tdata), .s_axis_tkeep(2'b11), .s_axis_tuser(tuser),
    .s_axis_tvalid(tvalid), .s_axis_tlast(tlast), .s_axis_tready(ready[1]), .m_axis_tdata(out[1][15:0]),
    .m_axis_tkeep(out[1][17:16]), .m_axis_tuser(out[1][18]), .m_axis_tvalid(valid[1]), .m_axis_tlast(out[1][19]),
    .m_axis_tready(tready){rest});
  always #1 clk = !clk;
  initial begin
    repeat (3) @(negedge clk);
    rst_n = 1;
    for (cycle = 0; cycle < {cycles}; cycle = cycle + 1) begin
      tready = $random(seed) % 4 != 0;
      // A beat stays until it is taken.
      if (!tvalid || ready[0]) begin
        tvalid = $random(seed) % 4 != 0;
        tdata  = $random(seed);
        tlast  = $random(seed) % 8 == 0;
        tuser  = tlast && $random(seed) % 8 == 0;
      end
      #0.5;
      if (ready[0] !== ready[1] || valid[0] !== valid[1] || (valid[0] && out[0] !== out[1])) begin
        $display("cycle %0d: %b %h and %b %h", cycle, valid[0], out[0], valid[1], out[1]);
        $finish(0);
      end
      beats = beats + (valid[0] && tready);
      @(negedge clk);
    end
    $display("%0d beats", beats);
    $finish(0);
  end
endmodule
"""
_ERRORS = ", .s_frame_error(1'b0), .s_frame_error_code(4'b0)"


@pytest.mark.check
@needs_tools
@pytest.mark.parametrize(
    ("entity", "generics", "rest"),
    [
        ("firm_axis_fifo", {"DEPTH": 512}, ""),
        ("firm_axis_queue", {"FRAMES": 4, "BEATS": 64, "DROP_OLDEST": True}, _ERRORS),
        ("firm_axis_length_buffer", {"DEPTH": 256}, _ERRORS),
    ],
)
def test_a_mapped_part_is_equal(tmp_path: Path, entity: str, generics: dict[str, Generic], rest: str) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files("axis/package", "axis/axis"))
    source, bench = tmp_path / "part.v", tmp_path / "bench.v"
    netlist = library.synthesise(entity, {"WIDTH": WIDTH, **generics}, "verilog")
    source.write_text(netlist.replace(f"module {entity}\n", "module part\n"))
    bench.write_text(_BENCH.format(seed=SEED, cycles=CYCLES, rest=rest))
    _run(tmp_path, "yosys", "read_verilog part.v; synth_ice40 -top part; rename part mapped; write_verilog m.v")
    assert "SB_RAM40_4K" in (tmp_path / "m.v").read_text()
    cells = Path(shutil.which("yosys") or "").parents[1] / "share" / "yosys" / "ice40" / "cells_sim.v"
    words = ["-g2012", "-DNO_ICE40_DEFAULT_ASSIGNMENTS", "-o", "bench", "bench.v", "part.v", "m.v", str(cells)]
    _run(tmp_path, "iverilog", *words)
    output = _run(tmp_path, "vvp", "bench")
    assert output.endswith(" beats\n"), output
    assert int(output.split()[0]) > CYCLES / 4


def _run(folder: Path, *words: str) -> str:
    program, *rest = words
    options = ["-q", "-p", *rest] if program == "yosys" else rest
    done = subprocess.run([program, *options], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
