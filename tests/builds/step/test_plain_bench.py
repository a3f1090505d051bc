"""The rules for benches without a runner, on printed lines and small sources."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.plain_bench import plain_bench

FAULTS = [
    "src/tb.vhd:4:30:@5ns:(assertion error): a is 1",
    "src/tb.vhd:4:30:@5ns:(report failure): a is 1",
    "src/tb.vhd:4:30:@5ns:(report note): TEST FAILED",
    "src/tb.vhd:4:30:@5ns:(report warning): Error: a is 1",
    "ERROR: src/tb.v:3: a is 0",
    "[5] %Error: tb.v:1: Assertion failed in TOP.tb: bad",
    "** Error: 5ns+0: bad",
    "# ** Fatal: bad",
    "FAIL",
    "test b: FAIL",
    "Error: sum is 3",
    "*** Failure at 5 ns",
    "mismatch in byte 3",
    "3 checks, 2 errors",
    "passed: 3, failed: 2",
    "1 of 3 tests failed",
    "errors = 12",
    "TIMEOUT",
    "the watchdog ended the simulation",
    "TESTS=2 PASS=1 FAIL=1 SKIP=0",
    "===== 1 skipped in 0.02s =====",
    "no tests ran in 0.01s",
]
GOOD = [
    "src/tb.vhd:4:30:@5ns:(report warning): slow",
    "WARNING: src/tb.v:3: slow",
    "3 checks, 0 errors",
    "no errors",
    "Errors: 0",
    "passed: 3, failed: 0",
    "0 of 3 tests failed",
    "TESTS=2 PASS=2 FAIL=0 SKIP=0",
    "TIMEOUT = 100 cycles",
    "testing the error pulse",
    "failures are corrected",
    "ERROR_CODE is 3",
    "===== 3 passed, 1 skipped in 0.02s =====",
    "1 xfailed in 0.02s",
    "Timeout: Exiting at time 100000",
]


def verdict(folder: Path, sources: Mapping[str, str], lines: list[str], **options: object) -> str:
    kinds = {".vhd": "vhdlSource-2008", ".v": "verilogSource", ".cpp": "cppSource"}
    for name, text in sources.items():
        (folder / name).write_text(text)
    files = [{"name": name, "file_type": kinds[Path(name).suffix]} for name in sources]
    bench = plain_bench({"files": files, "toplevel": "tb"}, options, folder)
    for line in lines:
        bench.see(line)
    return bench.verdict()


@pytest.mark.parametrize("line", FAULTS)
def test_a_line_of_a_failure(line: str, tmp_path: Path) -> None:
    assert line in verdict(tmp_path, {}, ["begin", line, "PASS"])


@pytest.mark.parametrize("line", GOOD)
def test_a_line_that_is_not_one_of_a_failure(line: str, tmp_path: Path) -> None:
    assert verdict(tmp_path, {}, [line]) == ""


@pytest.mark.parametrize(
    ("name", "source", "text"),
    [
        ("tb.v", 'module tb; initial $display("PASS"); endmodule', "PASS"),
        ("tb.v", 'module tb; initial begin $display("a: pass"); $display("%0d tests passed", 3); end endmodule', None),
        ("tb.v", 'module tb; /* "PASS" */ initial $display("hm"); // "PASS"\nendmodule', ""),
        ("tb.v", 'module tb; initial $display(ok ? "ALL OK" : "NOT ALL OK"); endmodule', "ALL OK"),
        ("tb.v", 'module tb; initial $display("%0d passed, %0d failed", 3, 0); endmodule', "passed,"),
        ("other.v", 'module other; initial $display("PASS"); endmodule', ""),
        ("tb.vhd", 'entity tb is end; -- "PASS"\narchitecture a of tb is begin end;', ""),
        (
            "tb.vhd",
            'entity tb is end; process begin report "end of simulation"; wait; end process;',
            "end of simulation",
        ),
        ("tb.vhd", 'ENTITY Tb IS end; process begin report "test done" severity note; end process;', "test done"),
        ("tb.vhd", 'entity tb is end; process begin report "pass/fail follows"; end process;', ""),
    ],
)
def test_the_text_of_success_in_the_sources(name: str, source: str, text: str | None, tmp_path: Path) -> None:
    """Of several texts, the last one counts; numbers in it do not."""
    text = "tests passed" if text is None else text
    expected = f"the bench ended before it printed '{text}'" if text else ""
    assert verdict(tmp_path, {name: source}, ["step 1"]) == expected
    assert verdict(tmp_path, {name: source}, [f"12 {text} 3"]) == ""
    assert verdict(tmp_path, {name: source}, [f"errors: 0 {text}"]) == ""
    assert verdict(tmp_path, {name: source}, [f"not {text}"]) == expected
    assert verdict(tmp_path, {name: source}, [f"0 {text}"]) == expected


@pytest.mark.parametrize(
    ("source", "passes"),
    [
        ("entity tb is end; architecture a of tb is begin assert x; end;", True),
        ('entity tb is end; process begin report "x" severity error; end process;', True),
        ("entity tb is end; process begin std.env.stop(1); end process;", True),
        ("entity tb is end; process begin std.env.stop; end process;", False),
        ("entity tb is end; -- assert\n", False),
    ],
)
def test_a_bench_that_prints_nothing_must_check_something(source: str, passes: bool, tmp_path: Path) -> None:
    noise = [
        "Entering directory '/b'",
        "ghdl -r --std=93 tb",
        "sh /x/launch.sh /x/python -m fusesoc_firm.tools.launcher ghdl -r tb",
        "/usr/bin/ghdl-mcode:info: simulation stopped by --stop-time @20ns",
        "simulation finished @5ns with status 0",
    ]
    found = verdict(tmp_path, {"tb.vhd": source}, noise)
    assert found == ("" if passes else "the bench printed nothing, and its sources check nothing")
    assert verdict(tmp_path, {"tb.vhd": source}, [*noise, "hello"]) == ""


def test_options_of_the_flow(tmp_path: Path) -> None:
    error, failure = "tb.vhd:4:30:@5ns:(report error): a", "tb.vhd:4:30:@5ns:(report failure): a"
    warning = "WARNING: tb.v:3: slow"
    assert verdict(tmp_path, {}, [error], fails_at="failure") == ""
    assert failure in verdict(tmp_path, {}, [error, failure], fails_at="failure")
    assert warning in verdict(tmp_path, {}, [warning], fails_at="warning")
    assert verdict(tmp_path, {}, [failure, "FAIL"], fails_at="none") == ""
    assert verdict(tmp_path, {}, [error], sim_options=["--assert-level=failure"]) == ""
    assert verdict(tmp_path, {}, ["Error: expected"], passes_with="12 equal") == (
        "the bench ended before it printed '12 equal'"
    )
    assert verdict(tmp_path, {}, ["Error: expected", "12 equal"], passes_with="12 equal") == ""
    assert verdict(tmp_path, {"tb.v": 'module tb; initial $display("PASS"); endmodule'}, ["x"], passes_with="") == ""
    with pytest.raises(RuntimeError, match="'errors'; legal: note, warning, error, failure, none"):
        verdict(tmp_path, {}, [], fails_at="errors")


def test_texts_of_messages_do_not_fail_a_generated_test_bench(tmp_path: Path) -> None:
    (tmp_path / "src").mkdir()
    sources = {"src/firm_sim_host.vhd": "entity firm_sim_host is end;"}
    assert verdict(tmp_path, sources, ["level=2 name='ERROR'", "PASS 1/1"]) == ""
    assert "PASS" in verdict(tmp_path, sources, ["level=2 name='ERROR'"])
