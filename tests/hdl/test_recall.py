"""What tests recall of tools: only where a new run could not differ, and never a failure."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.results import Results
from tests import recall
from tests.compilers import CompilerError, compile_program, verilated
from tests.hdl.ghdl import GhdlError, Library
from tests.hdl.verilog import compile_verilog

PACKAGE = "package numbers is\n  constant START : natural := {start};\nend package;\n"
BENCH = """\
use std.textio.all;
entity bench is
  generic (STEP : natural := 1);
end entity;
architecture sim of bench is
begin
  main : process is
    file input : text open read_mode is "input.txt";
    file output : text open write_mode is "output.txt";
    variable row : line;
    variable number : natural;
  begin
    readline(input, row);
    read(row, number);
    write(row, number + STEP + work.numbers.START);
    writeline(output, row);
    assert number < 100 report "too large" severity failure;
    report "done";
    wait;
  end process;
end architecture;
"""
VERILOG = """\
`include "numbers.vh"
module bench;
  parameter STEP = 1;
  integer file, found, number;
  initial begin
    file = $fopen("input.txt", "r");
    found = $fscanf(file, "%d", number);
    $display("%0d", number + STEP + `START);
    if (number >= 100) $fatal(0, "too large");
    $finish(0);
  end
endmodule
"""

Counted = Callable[[], tuple[int, int]]


@pytest.fixture
def counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Counted:
    """How many runs were recalled, and how many ran, since it was asked last; the store is new."""
    store = Results(tmp_path / "store", 2**30)
    monkeypatch.setattr(recall, "store", lambda: store)
    counts = recall.Counts()
    monkeypatch.setattr(recall, "COUNTS", counts)

    def read() -> tuple[int, int]:
        found = counts.recalled, counts.run
        counts.recalled = counts.run = 0
        return found

    return read


def simulated(
    folder: Path, number: int = 3, start: int = 10, step: int = 1, comment: str = "", further: str = ""
) -> tuple[int, str, str]:
    """The exit code, the report and the output of the bench in GHDL, in a new folder."""
    folder.mkdir()
    (folder / "input.txt").write_text(f"{number}\n")
    files = {"numbers": PACKAGE.format(start=start), "bench": f"{BENCH}{comment}", "other": further}
    for name, text in files.items():
        (folder / f"{name}.vhd").write_text(text)
    library = Library("work", folder)
    library.analyse(folder / f"{name}.vhd" for name, text in files.items() if text)
    done = library.run("bench", {"STEP": step})
    return done.exit_code, done.output, (folder / "output.txt").read_text()


def test_a_simulation_is_recalled_elsewhere(tmp_path: Path, counted: Counted) -> None:
    first = simulated(tmp_path / "one")
    assert counted() == (0, 2)  # the analysis, and the run
    again = simulated(tmp_path / "two")
    assert counted() == (2, 0)
    assert not [*(tmp_path / "two").glob("*.cf")]
    assert first[2] == again[2] == "14\n"
    assert again == (0, first[1].replace(str(tmp_path / "one"), str(tmp_path / "two")), "14\n")
    assert str(tmp_path / "two") in again[1]


@pytest.mark.parametrize(
    ("changed", "runs"),
    [
        ({"number": 4}, 1),
        ({"step": 2}, 1),
        ({"start": 11}, 2),
        ({"comment": "-- a comment\n"}, 2),
        # The analysis is of all files; the run does not depend on an entity that nothing names.
        ({"further": "entity another is end entity;\n"}, 1),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_what_has_changed_runs(tmp_path: Path, counted: Counted, changed: dict[str, int], runs: int) -> None:
    simulated(tmp_path / "one")
    counted()
    found = simulated(tmp_path / "two", **changed)  # type: ignore[arg-type]
    assert counted() == (2 - runs, runs)
    values = {"number": 3, "step": 1, "start": 10, **changed}
    assert found[2] == f"{values['number'] + values['step'] + values['start']}\n"


def test_a_file_may_change_after_its_analysis(tmp_path: Path, counted: Counted) -> None:
    """What depends on it was analysed with what it contained then, also if that is done only later."""

    def replaced(folder: Path, start: int) -> str:
        simulated(folder)
        counted()
        (folder / "numbers.vhd").write_text(PACKAGE.format(start=start))
        library = Library("work", folder)
        library.analyse([folder / "numbers.vhd", folder / "bench.vhd"])
        assert library.run("bench", directory=folder).exit_code == 0
        assert PACKAGE.format(start=start) == (folder / "numbers.vhd").read_text()
        return (folder / "output.txt").read_text()

    simulated(tmp_path / "one")
    assert replaced(tmp_path / "two", 20) == "24\n"
    assert counted() == (0, 2)
    assert replaced(tmp_path / "three", 20) == "24\n"
    assert counted() == (2, 0)
    assert replaced(tmp_path / "four", 30) == "34\n"
    assert counted() == (0, 2)


def test_a_path_in_a_netlist_s_comment_changes_nothing(tmp_path: Path, counted: Counted) -> None:
    """Tests write netlists to folders whose names differ from run to run."""
    simulated(tmp_path / "one", comment=f"-- {tmp_path}/a.vhd\n")
    simulated(tmp_path / "two", comment=f"-- {tmp_path.with_name('other7')}/a.vhd\n")
    assert counted() == (2, 2)
    simulated(tmp_path / "three", comment=f"-- {tmp_path}/b.vhd\n")
    assert counted() == (0, 2)
    # Elsewhere than in a comment, a path may name an input.
    unit = 'package names is constant NAME : string := "{}/a.txt"; end package; -- {}/a\n'
    simulated(tmp_path / "four", comment=unit.format(tmp_path, tmp_path))
    simulated(tmp_path / "five", comment=unit.format(tmp_path.with_name("other7"), tmp_path))
    assert counted() == (0, 4)


def test_a_failure_is_not_stored(tmp_path: Path, counted: Counted) -> None:
    assert simulated(tmp_path / "one", 100)[0] != 0
    counted()
    assert simulated(tmp_path / "two", 100)[0] != 0
    assert counted() == (1, 1)
    for place in ("three", "four"):
        with pytest.raises(GhdlError, match=f"{place}/bench.vhd"):
            simulated(tmp_path / place, comment="nonsense\n")
        assert counted() == (0, 1)


@pytest.mark.parametrize("damage", [b"", b"other bytes", None])
def test_what_is_damaged_is_missing(tmp_path: Path, counted: Counted, damage: bytes | None) -> None:
    simulated(tmp_path / "one")
    counted()
    for path in (tmp_path / "store").rglob("*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[:-1] if damage is None else damage)
    assert simulated(tmp_path / "two")[2] == "14\n"
    assert counted() == (0, 2)
    assert simulated(tmp_path / "three")[2] == "14\n"
    assert counted() == (2, 0)


def test_a_netlist_and_a_unit_of_another_library_are_recalled(tmp_path: Path, counted: Counted) -> None:
    def made(folder: Path, value: str) -> str:
        folder.mkdir()
        (folder / "part.vhd").write_text(
            "library ieee;\nuse ieee.std_logic_1164.all;\n"
            "entity part is port (q : out std_logic); end entity;\n"
            f"architecture rtl of part is begin q <= '{value}'; end architecture;\n"
        )
        (folder / "whole.vhd").write_text(
            "library ieee;\nuse ieee.std_logic_1164.all;\nlibrary parts;\n"
            "entity whole is port (q : out std_logic); end entity;\n"
            "architecture rtl of whole is begin\n  inner : entity parts.part port map (q => q);\nend architecture;\n"
        )
        Library("parts", folder).analyse([folder / "part.vhd"])
        Library("work", folder).analyse([folder / "whole.vhd"])
        return Library("work", folder).synthesise("whole", None, "verilog")

    first = made(tmp_path / "one", "0")
    counted()
    assert made(tmp_path / "two", "0") == first.replace(str(tmp_path / "one"), str(tmp_path / "two"))
    assert counted() == (3, 0)
    assert made(tmp_path / "three", "1") != first
    assert counted() == (0, 3)


def test_icarus_is_recalled(tmp_path: Path, counted: Counted) -> None:
    if not shutil.which("iverilog"):
        pytest.skip("Icarus Verilog is not installed")

    def simulated(folder: Path, start: int = 10, step: int = 1, number: int = 3) -> tuple[int, str]:
        folder.mkdir()
        (folder / "input.txt").write_text(f"{number}\n")
        (folder / "bench.v").write_text(VERILOG)
        (folder / "numbers.vh").write_text(f"`define START {start}\n")
        done = compile_verilog("bench", [folder / "bench.v"], folder, {"STEP": step}).run(folder)
        return done.exit_code, done.output

    assert simulated(tmp_path / "one") == simulated(tmp_path / "two") == (0, "14\n")
    assert counted() == (2, 2)
    assert simulated(tmp_path / "three", start=20) == (0, "24\n")
    assert counted() == (0, 2)
    assert simulated(tmp_path / "four", step=2) == (0, "15\n")
    assert counted() == (0, 2)
    assert simulated(tmp_path / "five", number=5) == (0, "16\n")
    assert counted() == (1, 1)
    for place in ("six", "seven"):
        assert simulated(tmp_path / place, number=100)[0] != 0
        assert counted() == (1, 1)


def test_a_program_is_compiled_again_for_each_file_that_it_reads(tmp_path: Path, counted: Counted) -> None:
    (tmp_path / "headers").mkdir()
    header = tmp_path / "headers" / "number.h"

    def printed(folder: Path, number: int, source: str = 'printf("%s %d\\n", __FILE__, NUMBER)') -> str:
        header.write_text(f"#define NUMBER {number}\n")
        folder.mkdir()
        (folder / "main.c").write_text(
            f'#include <stdio.h>\n#include "number.h"\nint main(void) {{ {source}; return 0; }}\n'
        )
        compile_program(["gcc", "-g", "-I", str(header.parent), str(folder / "main.c"), "-o", "program"], folder)
        assert sorted(path.name for path in folder.iterdir()) == ["main.c", "program"]
        return subprocess.run([folder / "program"], capture_output=True, text=True, check=True).stdout

    assert printed(tmp_path / "one", 1) == printed(tmp_path / "two", 1) == "./main.c 1\n"
    assert counted() == (1, 1)
    assert printed(tmp_path / "three", 2) == "./main.c 2\n"
    assert counted() == (0, 1)
    for place in ("four", "five"):
        with pytest.raises(CompilerError, match="nonsense"):
            printed(tmp_path / place, 2, "nonsense")
        assert counted() == (0, 1)


def test_a_program_is_compiled_again_for_each_source_elsewhere(tmp_path: Path, counted: Counted) -> None:
    sources = [tmp_path / "main.c", tmp_path / "other.c"]

    def returned(folder: Path, value: int) -> int:
        sources[0].write_text("int other(void);\nint main(void) { return other(); }\n")
        sources[1].write_text(f"int other(void) {{ return {value}; }}\n")
        folder.mkdir()
        compile_program(["gcc", *map(str, sources), "-o", "program"], folder)
        return subprocess.run([folder / "program"], check=False).returncode

    assert [returned(tmp_path / name, 1) for name in ("one", "two")] == [1, 1]
    assert counted() == (1, 1)
    assert returned(tmp_path / "three", 2) == 2
    assert counted() == (0, 1)


@pytest.mark.check
def test_a_model_is_compiled_again_for_each_file_that_it_reads(tmp_path: Path, counted: Counted) -> None:
    if not shutil.which("verilator"):
        pytest.skip("Verilator is not installed")
    header = tmp_path / "number.h"

    def printed(folder: Path, number: int, value: int) -> str:
        header.write_text(f"#define NUMBER {number}\n")
        folder.mkdir()
        (folder / "top.v").write_text(f"module top(output [7:0] q); assign q = {value}; endmodule\n")
        (folder / "main.cpp").write_text(
            '#include "Vtop.h"\n#include "number.h"\n#include <cstdio>\n'
            'int main() { Vtop top; top.eval(); std::printf("%d %d\\n", top.q, NUMBER); }\n'
        )
        options = ["--cc", "--exe", "--build", "-CFLAGS", f"-I{tmp_path}", "--Mdir", "made", "--top-module", "top"]
        program = verilated(["verilator", *options, "top.v", "main.cpp"], folder, "made", "top", ["top.v", "main.cpp"])
        assert [path.name for path in program.parent.iterdir()] == ["Vtop"]
        return subprocess.run([program], capture_output=True, text=True, check=True).stdout

    assert printed(tmp_path / "one", 1, 7) == printed(tmp_path / "two", 1, 7) == "7 1\n"
    assert counted() == (1, 1)
    assert printed(tmp_path / "three", 2, 7) == "7 2\n"
    assert printed(tmp_path / "four", 2, 8) == "8 2\n"
    assert counted() == (0, 2)


PROGRAM = """#!/usr/bin/env python3
import sys
print("starts", file=open(sys.argv[1], "a"))
total = int(sys.argv[2])
for line in sys.stdin:
    total += int(line)
    print(total, "done", sep="\\n", flush=True)
"""


def test_a_conversation_is_recalled_as_far_as_it_goes(tmp_path: Path, counted: Counted) -> None:
    (program := tmp_path / "program").write_text(PROGRAM)
    program.chmod(0o755)
    starts = tmp_path / "starts"

    def said(*numbers: int, first: int = 0) -> list[str]:
        starts.write_text("")
        with recall.Conversation([str(program), str(starts), str(first)], "done\n") as conversation:
            return [line for number in numbers for line in conversation.ask(f"{number}\n")]

    assert said(1, 2, 3) == ["1\n", "3\n", "6\n"]
    assert (counted(), starts.read_text()) == ((0, 1), "starts\n")
    assert said(1, 2, 3) == ["1\n", "3\n", "6\n"]
    assert (counted(), starts.read_text()) == ((1, 0), "")
    assert said(1, 2, 4) == ["1\n", "3\n", "7\n"]
    assert said(1, 2, 4, 5) == ["1\n", "3\n", "7\n", "12\n"]
    assert said(1, 2, 4, 5, first=1) == ["2\n", "4\n", "8\n", "13\n"]
    assert counted() == (0, 3)
    with pytest.raises(AssertionError, match="ended"), recall.Conversation(["true"], "done\n") as conversation:
        conversation.ask("")
