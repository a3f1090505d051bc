"""`firm test` on a small library of somebody else: three simulators, by flows and by tools, run and cached."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.sandbox import can_sandbox
from fusesoc_firm.builds.step.trace import can_trace, traced
from fusesoc_firm.builds.step.tree import tree_of
from fusesoc_firm.builds.store.server import Server
from fusesoc_firm.builds.store.store import Store
from fusesoc_firm.tools.library_path import library_root
from fusesoc_firm.tools.programs import find
from tests.builds.store.test_remote import SECRET, served
from tests.certificates import needs_openssl, tls_files, write_certificates
from tests.hdl.ghdl import REPOSITORY
from tests.house.test_build import wait_until

pytestmark = pytest.mark.skipif(not can_trace(), reason="strace is not installed or not permitted")

CORES = """\
CAPI=2:
name: acme:m:counter:1.0
filesets:
  rtl: {files: [counter.vhd: {file_type: vhdlSource-93}]}
  bench: {files: [bench.vhd: {file_type: vhdlSource-93}]}
  data: {files: [limit.txt: {file_type: user, copyto: limit.txt}]}
targets:
  default: {filesets: [rtl]}
  sim: {filesets: [rtl, bench, data], toplevel: bench, flow: sim, flow_options: {tool: ghdl}}
  test_old: {filesets: [rtl, bench, data], toplevel: bench, default_tool: ghdl}
  bench: {filesets: [rtl, bench, data], toplevel: bench, flow: sim, flow_options: {tool: ghdl}}
  simple: {filesets: [rtl], toplevel: counter, flow: lint, flow_options: {tool: verilator}}
---
CAPI=2:
name: acme:m:gate:1.0
filesets:
  rtl: {files: [gate.v: {file_type: verilogSource}]}
targets:
  default: {filesets: [rtl]}
  sim_icarus: {filesets: [rtl], toplevel: gate, flow: sim, flow_options: {tool: icarus}}
  sim_verilator:
    filesets: [rtl]
    toplevel: gate
    flow: sim
    flow_options: {tool: verilator, mode: cc, verilator_options: [--main, --timing]}
"""
FILES = {
    "fusesoc.conf": "[main]\nignored_dirs = build\n[library.acme]\nlocation = .\n",
    "counter/counter.vhd": """\
entity counter is
  port (clk : in bit; value : out integer);
end entity;
architecture rtl of counter is
  signal count : integer := 0;
begin
  count <= count + 1 when clk'event and clk = '1';
  value <= count;
end architecture;
""",
    "counter/bench.vhd": """\
use std.textio.all;
entity bench is
end entity;
architecture simulation of bench is
  signal clk : bit;
  signal value : integer;
begin
  dut : entity work.counter port map (clk, value);
  process
    file limits : text open read_mode is "limit.txt";
    variable words : line;
    variable limit : integer;
  begin
    readline(limits, words);
    read(words, limit);
    for edge in 1 to 10 loop
      clk <= '1';
      wait for 1 ns;
      clk <= '0';
      wait for 1 ns;
    end loop;
    assert value <= limit report "too high" severity failure;
    report "counted";
    wait;
  end process;
end architecture;
""",
    "counter/limit.txt": "10\n",
    "gate/gate.v": """\
module gate;
  initial begin
    $display("open");
    $finish;
  end
endmodule
""",
}
READER = """\
module gate;
  reg [8191:0] name;
  reg [7:0] code [0:0];
  initial begin
    if ($value$plusargs("code=%s", name))
      $readmemh(name, code);
    $display("code %h", code[0]);
    $finish;
  end
endmodule
"""
BLINK = """\
module blink(input clk, output reg led);
  always @(posedge clk) led <= !led;
endmodule
"""
TOOLS = {"make", "ghdl", "ghdl-mcode", "iverilog", "vvp", "verilator", "verilator_bin", "g++", "vgate", "sh"}


@pytest.fixture
def library(tmp_path: Path) -> Path:
    folder = tmp_path / "library"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    for text in CORES.split("---\n"):
        name = text.split(":")[4]
        (folder / name / f"{name}.core").write_text(text)
    return folder


def command(*arguments: str, name: str = "test") -> list[str]:
    return [sys.executable, "-m", "fusesoc_firm.cli", name, *arguments]


def environment(library: Path, **variables: str) -> dict[str, str]:
    own = {
        "PYTHONPATH": str(REPOSITORY),
        "FUSESOC_FIRM_CACHE": str(library.parent / "store"),
        "FUSESOC_FIRM_ACTIONS_TWICE": "0",
    }
    return {**os.environ, **own, **variables}


def run(library: Path, *arguments: str, name: str = "test", **variables: str) -> tuple[int, str]:
    done = subprocess.run(
        command(*arguments, name=name),
        cwd=library,
        env=environment(library, **variables),
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def results(text: str) -> dict[str, str]:
    return dict(re.findall(r"^acme:m:\w+:1\.0 +(\w+) +(\w+) ", text, re.MULTILINE))


def test_unchanged_tests_start_no_tool(library: Path) -> None:
    tests = ["sim", "sim_icarus", "sim_verilator", "test_old"]
    status, text = run(library)
    assert (status, sorted(results(text).items())) == (0, [(test, "passed") for test in tests]), text
    log = library / "build" / "acme_m_counter_1.0" / "sim.log"
    first = log.read_text()
    assert "counted" in first
    with (library / "output").open("wb") as output:
        status, trace = traced(command(), library, environment(library), output)
    text = (library / "output").read_text()
    assert (status, sorted(results(text).items())) == (0, [(test, "cached") for test in tests]), text
    assert not {Path(path).name.lower() for path in trace.programs} & TOOLS
    # The log of the simulation is in the log of the recalled build.
    assert first[first.index("Entering") :] in log.read_text()
    assert re.search(r"4 tests in [\d.]+ s: 4 cached, 0 passed, 0 failed; [\d.]+ s saved", text)


def is_recalled(library: Path, *arguments: str, name: str = "test") -> bool:
    """Run a command; return whether everything was cached, and FuseSoC's reader of cores was not even imported."""
    status, text = run(library, *arguments, name=name, PYTHONPROFILEIMPORTTIME="1")
    assert status == 0, text
    return set(results(text).values()) == {"cached"} and "fusesoc.coremanager" not in text


def test_an_unchanged_command_is_recalled_without_a_setup(library: Path) -> None:
    selected = ("acme:m:counter", "--target", "sim")
    assert not is_recalled(library, *selected)
    assert is_recalled(library, *selected)
    # A removed folder of builds is not needed.
    shutil.rmtree(library / "build")
    assert is_recalled(library, *selected)
    # After an edit of a source, or of a library by a new core, FuseSoC sets the build up again.
    source = library / "counter" / "counter.vhd"
    source.write_text(source.read_text() + "\n")
    assert not is_recalled(library, *selected)
    (library / "new").mkdir()
    (library / "new" / "new.core").write_text("CAPI=2:\nname: acme:m:new:1.0\ntargets: {default: {}}\n")
    assert not is_recalled(library, *selected)
    assert is_recalled(library, *selected)
    # Other options are another command.
    assert not is_recalled(library, *selected, "--rerun")


def test_firm_build_restores_outputs(library: Path) -> None:
    selected = ("acme:m:gate", "--target", "sim_icarus", "--cached", "--build-only")
    # The environment, which belongs to a command's note, is that of `is_recalled`.
    status, text = run(library, *selected, name="build", PYTHONPROFILEIMPORTTIME="1")
    assert (status, results(text)) == (0, {"sim_icarus": "ok"}), text
    program = library / "build" / "acme_m_gate_1.0" / "sim_icarus" / "acme_m_gate_1.0"
    content = program.read_bytes()
    assert is_recalled(library, *selected, name="build")
    shutil.rmtree(library / "build")
    status, text = run(library, *selected, name="build", PYTHONPROFILEIMPORTTIME="1")
    assert (status, results(text)) == (0, {"sim_icarus": "cached"}), text
    assert program.read_bytes() == content
    assert os.access(program, os.X_OK)
    status, text = run(library, *selected, "--cluster", "tcp://x", name="build")
    assert status == 1
    assert "--cached cannot be combined" in text


def test_second_runs_of_steps_write_the_same_bytes(library: Path) -> None:
    """GHDL writes times into its libraries, and Icarus Verilog addresses into its programs."""
    for expected in ("passed", "cached"):
        status, text = run(library, "--target", "sim", "sim_icarus", FUSESOC_FIRM_ACTIONS_TWICE="1")
        assert (status, results(text)) == (0, {"sim": expected, "sim_icarus": expected}), text


@pytest.mark.check
@pytest.mark.parametrize(
    ("flow", "program"),
    [
        ("flow: generic, flow_options: {tool: yosys, arch: xilinx}", "yosys"),
        ("flow: icestorm, flow_options: {nextpnr_options: [--hx1k, --package, tq144]}", "nextpnr-ice40"),
    ],
    ids=("netlist", "bitstream"),
)
def test_netlists_and_bitstreams_are_cached(library: Path, flow: str, program: str) -> None:
    """Yosys keeps a history of commands in HOME, and both programs log how long they took."""
    if find(program) is None or find("yosys") is None:
        pytest.skip(f"{program} or yosys is not installed")
    with (library / "gate" / "gate.core").open("a") as core:
        core.write(f"  made: {{filesets: [rtl], toplevel: blink, {flow}}}\n")
    (library / "gate" / "gate.v").write_text(BLINK)
    selected = ("acme:m:gate", "--target", "made", "--cached", "--build-only")
    status, text = run(library, *selected, name="build", FUSESOC_FIRM_ACTIONS_TWICE="1")
    assert (status, results(text)) == (0, {"made": "ok"}), text
    assert "not cached" not in text
    place = library / "build" / "acme_m_gate_1.0" / "made"
    made = {path.name: path.read_bytes() for path in place.glob("acme_m_gate_1.0.*")}
    shutil.rmtree(library / "build")
    status, text = run(library, *selected, name="build")
    assert (status, results(text)) == (0, {"made": "cached"}), text
    assert {path.name: path.read_bytes() for path in place.glob("acme_m_gate_1.0.*")} == made


@pytest.mark.check
@pytest.mark.skipif(not can_sandbox(), reason="bwrap is not installed or not permitted")
def test_a_sandbox_changes_no_output(library: Path) -> None:
    """The same bytes of a program, a library and logs, apart from GHDL's times; and what an action did not declare."""
    selected = ("acme:m:*", "--target", "sim", "sim_icarus", "sim_verilator", "--where-present")
    assert run(library, *selected, "--cached", name="build")[0] == 0
    outside = outputs(library)
    status, text = run(library, *selected, "--sandbox", name="build")
    # A result of a step outside a sandbox is not a result of this step.
    assert (status, set(results(text).values())) == (0, {"ok"}), text
    assert outputs(library) == outside
    assert any(path.name == "Vgate" for path in outside)
    bench = library / "counter" / "bench.vhd"
    bench.write_text(bench.read_text().replace('"limit.txt"', f'"{library}/counter/limit.txt"'))
    edited = ("acme:m:counter", "--target", "sim", "--rerun")
    assert "is not an input of its core" in run(library, *edited)[1]
    status, text = run(library, *edited, "--sandbox")
    assert (status, results(text)) == (1, {"sim": "failed"}), text
    status, text = run(library, *edited, "--sandbox", "--no-export")
    assert (status, "cannot be combined with --no-export" in text) == (1, True), text


def outputs(library: Path) -> dict[Path, str]:
    """Return the identities of all files of builds."""
    return {
        root / path: item.identity or item.digest
        for root in (library / "build").glob("*/*/")
        for path, item in tree_of(root, Contents()).items()
    }


def test_an_edit_runs_its_dependents_and_a_failure_is_not_cached(library: Path) -> None:
    cores = ("acme:m:counter", "--target", "sim", "test_old")
    assert run(library, *cores)[0] == 0
    (library / "counter" / "limit.txt").write_text("5\n")
    for _ in range(2):
        status, text = run(library)
        assert status == 1
        assert results(text)["sim"] == results(text)["test_old"] == "failed"
        assert "too high" in text
    assert results(text)["sim_icarus"] == "cached"
    (library / "counter" / "limit.txt").write_text("10\n")
    shutil.rmtree(library / "build")
    status, text = run(library, *cores)
    assert (status, set(results(text).values())) == (0, {"cached"})
    assert set(results(run(library, *cores, "--rerun")[1]).values()) == {"passed"}


@pytest.mark.check
def test_a_second_machine_runs_nothing(library: Path) -> None:
    """With an empty store of its own, and the remote store to which the first one wrote."""
    token = {"FUSESOC_FIRM_REMOTE_TOKEN": SECRET}
    with served(Server(Store(library.parent / "server", 2**30), "127.0.0.1", 0, SECRET)) as url:
        status, text = run(library, FUSESOC_FIRM_REMOTE=url, **token)
        assert (status, set(results(text).values())) == (0, {"passed"}), text
        shutil.rmtree(library / "build")
        shutil.rmtree(library.parent / "store")
        status, text = run(library, FUSESOC_FIRM_REMOTE=url)
        assert (status, set(results(text).values())) == (0, {"cached"}), text
        assert "counted" in (library / "build" / "acme_m_counter_1.0" / "sim.log").read_text()
        # The outputs come along where they are wanted.
        selected = ("acme:m:gate", "--target", "sim_icarus", "--cached")
        status, text = run(library, *selected, name="build", FUSESOC_FIRM_REMOTE=url)
        assert (status, results(text)) == (0, {"sim_icarus": "cached"}), text
        assert (library / "build" / "acme_m_gate_1.0" / "sim_icarus" / "acme_m_gate_1.0").is_file()
    # A server that is down costs one warning and the work.
    shutil.rmtree(library.parent / "store")
    status, text = run(library, "acme:m:counter", FUSESOC_FIRM_REMOTE=url)
    assert (status, set(results(text).values())) == (0, {"passed"}), text
    assert text.count("warning: ") == 1
    assert f"warning: remote store {url}: Connection refused" in text


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("arguments", "tests"),
    [
        (("acme:m:*", "--target", "sim_i*"), {"sim_icarus"}),
        (("acme:m:counter@test*", "acme:m:gate@sim_icarus"), {"test_old", "sim_icarus"}),
        (("counter", "gate", "--target", "sim", "--where-present"), {"sim"}),
        (("--target", "sim_icarus", "--tool", "ghdl"), {"sim_icarus"}),
    ],
)
def test_tests_are_selected_like_builds(library: Path, arguments: tuple[str, ...], tests: set[str]) -> None:
    status, text = run(library, *arguments, "--timeout", "100")
    assert (status, results(text)) == (0, dict.fromkeys(tests, "passed")), text


@pytest.mark.check
def test_reports_tell_what_was_cached(library: Path) -> None:
    """The same counts in the summary, in the events and in JUnit's file, for both commands."""
    (library / "counter" / "limit.txt").write_text("5\n")
    reports = ("--events", "events", "--junit", "junit.xml")
    for name, good, *selected in (
        ("test", "passed", "--target", "sim", "sim_icarus"),
        ("build", "ok", "acme:m:*", "--target", "sim", "sim_icarus", "--where-present", "--cached"),
    ):
        for expected in (good, "cached", good):
            rerun = ["--rerun"] if (library / "again").exists() else []
            status, text = run(library, *selected, *rerun, *reports, name=name)
            assert (status, results(text)) == (1, {"sim": "failed", "sim_icarus": expected}), text
            counts = {"cached": expected == "cached", good: expected == good, "failed": 1, "flaky": 0, "skipped": 0}
            (library / "again").touch() if expected == "cached" else (library / "again").unlink(missing_ok=True)
            assert re.search(
                rf"2 {name}s in [\d.]+ s: {counts['cached']:d} cached, {counts[good]:d} {good}, 1 failed; ", text
            )
            events = [json.loads(line) for line in (library / "events").read_text().splitlines()]
            assert len(events[0]["builds"]) == 2
            assert {event: counts[event] for event in counts} == {event: events[-1][event] for event in counts}
            steps = {event["target"]: event["steps"] for event in events if event["event"] == "end"}
            assert [step["state"] for step in steps["sim_icarus"]] == [{"cached": "cached"}.get(expected, "ran")] * 2
            assert steps["sim"][-1]["state"] == "failed"
            suite = ET.parse(library / "junit.xml").getroot()[0]
            assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == (f"firm {name}", "2", "1")
            assert [item.text for item in suite.iter("system-out")] == ["cached"] * (expected == "cached")
        shutil.rmtree(library / "build")
        shutil.rmtree(library.parent / "store")
    assert "--rerun needs --cached or --sandbox" in run(library, "gate@sim_icarus", "--rerun", name="build")[1]


@pytest.mark.check
def test_why_a_step_ran(library: Path) -> None:
    selected = ("acme:m:counter", "--target", "sim")

    def why(*arguments: str, is_good: bool = True, **variables: str) -> list[str]:
        assert run(library, *selected, *arguments, **variables)[0] == (0 if is_good else 1)
        status, text = run(library, *selected, name="why")
        assert status == 0, text
        return [line.strip() for line in text.splitlines()[1:]]

    status, text = run(library, *selected, name="why")
    assert (status, "has no cached steps here" in text) == (1, True)
    edited = ["limit.txt differs", "src/acme_m_counter_1.0/limit.txt differs"]
    new = "it has not run in this folder before"
    assert why() == ["build  ran", new, "run    ran", new]
    assert why() == ["build  cached", "run    cached"]
    limit = library / "counter" / "limit.txt"
    limit.write_text("11\n")
    assert why() == ["build  ran", *edited, "run    ran", *edited]
    # What was recalled counts as well.
    limit.write_text("10\n")
    assert why() == ["build  cached", "run    cached"]
    limit.write_text("5\n")
    assert why(is_good=False) == ["build  ran", *edited, "run    failed", *edited]
    failed = "the last run failed, or its result is not stored"
    assert why(is_good=False) == ["build  cached", "run    failed", failed]
    limit.write_text("10\n")
    assert why(SECRET="a-value")[:4] == ["build  ran", *edited, "the variable SECRET is new"]
    assert why("--rerun", SECRET="a-value") == ["build  ran", "--rerun", "run    ran", "--rerun"]
    notes = [path.read_text(errors="replace") for path in (library.parent / "store").glob("*/notes/*/*")]
    assert any("SECRET" in note for note in notes)
    assert not any("a-value" in note for note in notes)


def test_a_file_in_a_parameter_is_an_input(library: Path) -> None:
    """A file outside the core, such as a processor's firmware, that the user names."""
    core, firmware = library / "gate" / "gate.core", library.parent / "firmware.hex"
    core.write_text(
        core.read_text().replace(
            "toplevel: gate, flow: sim, flow", "toplevel: gate, parameters: [code], flow: sim, flow"
        )
        + "parameters: {code: {datatype: file, paramtype: plusarg}}\n"
    )
    (library / "gate" / "gate.v").write_text(READER)
    firmware.write_text("2a\n")

    def result() -> str:
        status, text = run(library, "acme:m:gate@sim_icarus", f"--backend=--code={firmware}")
        assert status == 0 and "is not cached" not in text
        return results(text)["sim_icarus"]

    log = library / "build" / "acme_m_gate_1.0" / "sim_icarus.log"
    assert [result(), result()] == ["passed", "cached"]
    assert "code 2a" in log.read_text()
    firmware.write_text("2b\n")
    assert result() == "passed"
    assert "code 2b" in log.read_text()


def test_what_is_not_cached_is_reported(library: Path) -> None:
    """A test bench that reads a file that is not in its core."""
    bench = library / "counter" / "bench.vhd"
    bench.write_text(bench.read_text().replace('"limit.txt"', f'"{library}/counter/limit.txt"'))
    for _ in range(2):
        status, text = run(library, "acme:m:counter", "--target", "sim")
        assert (status, results(text)) == (0, {"sim": "passed"})
        line = "'run' of acme:m:counter:1.0 sim is not cached: it reads {}, which is not an input of its core"
        assert line.format(library / "counter" / "limit.txt") in text.splitlines()


def test_without_export_nothing_is_cached(library: Path) -> None:
    for _ in range(2):
        status, text = run(library, "acme:m:counter", "--target", "sim", "--no-export")
        assert (status, results(text)) == (0, {"sim": "passed"})
        assert "is not cached: with --no-export, its inputs are not in the folder of the build" in text


def test_a_selected_target_may_have_any_name(library: Path) -> None:
    for arguments in (["acme:m:counter@bench"], ["acme:m:counter", "--target", "bench"]):
        status, text = run(library, *arguments)
        assert (status, [*results(text)]) == (0, ["bench"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("acme:m:nothing",), "unknown core 'acme:m:nothing'"),
        (("acme:m:gate", "--target", "sim"), "acme:m:gate:1.0 has no test 'sim'"),
        (("acme:m:counter", "--target", "simple"), "its tests: sim, test_old"),
    ],
)
def test_unknown_tests_are_reported(library: Path, arguments: tuple[str, ...], message: str) -> None:
    status, text = run(library, *arguments)
    assert status == 1
    assert message in text


def test_a_folder_without_tests(tmp_path: Path) -> None:
    (tmp_path / "library").mkdir()
    status, text = run(tmp_path / "library")
    assert status == 1
    assert "no core below this folder has a test" in text


def apart(folder: Path, scheduler: str) -> list[str]:
    """Return the command of a Dask worker that sees neither the project nor the folders of another worker."""
    own = ("--ro-bind", "/", "/", "--dev", "/dev", "--proc", "/proc", "--tmpfs", str(folder), "--die-with-parent")
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", scheduler, "--nthreads", "1", "--no-dashboard"]
    return ["bwrap", *own, "--unshare-pid", *worker, "--no-nanny"]


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[str]:
    """Two workers in namespaces that share no folder but the installation; yield the scheduler's address."""
    with workers_apart(tmp_path, "tcp://") as address:
        yield address


@contextmanager
def workers_apart(folder: Path, protocol: str, security: Any = None) -> Iterator[str]:
    """Start the workers of `machines`, with the environment of this process."""
    distributed = pytest.importorskip("distributed", reason="no distributed; make test installs it")
    with (
        ExitStack() as stack,
        distributed.LocalCluster(
            n_workers=0,
            host="127.0.0.1",
            protocol=protocol,
            dashboard_address=":0",
            processes=False,
            security=security,
        ) as cluster,
    ):
        for number in range(2):
            own = {
                "FUSESOC_FIRM_CACHE": f"{folder}/own/{number}",
                "PYTHONPATH": str(REPOSITORY),
                "TMPDIR": str(folder),
            }
            process = subprocess.Popen(
                apart(folder, cluster.scheduler_address),
                cwd="/",
                env={**os.environ, **own},
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait)
            stack.callback(process.terminate)
        with distributed.Client(cluster) as client:
            client.wait_for_workers(2, timeout=60)
        yield cluster.scheduler_address


@pytest.mark.check
@pytest.mark.xdist_group("dask")
@pytest.mark.skipif(not can_sandbox(), reason="bwrap is not installed or not permitted")
def test_a_cluster_without_a_shared_folder(library: Path, machines: str) -> None:
    """Inputs and outputs travel through the remote store."""
    token = {"FUSESOC_FIRM_REMOTE_TOKEN": SECRET}
    selected = ("acme:m:*", "--target", "sim", "sim_icarus", "test_old", "--where-present", "--cluster", machines)
    with served(Server(Store(library.parent / "server", 2**30), "127.0.0.1", 0, SECRET)) as url:
        remote = {"FUSESOC_FIRM_REMOTE": url, **token}
        status, text = run(library, *selected, name="build", **remote)
        assert (status, results(text)) == (0, dict.fromkeys(("sim", "sim_icarus", "test_old"), "ok")), text
        built = library / "build" / "acme_m_gate_1.0" / "sim_icarus"
        log = built.with_name("sim_icarus.log").read_text()
        assert "open" in log
        assert os.access(built / "acme_m_gate_1.0", os.X_OK)
        (library / "counter" / "limit.txt").write_text("5\n")
        status, text = run(library, *selected, name="build", **remote)
        assert (status, results(text)) == (1, {"sim": "failed", "sim_icarus": "ok", "test_old": "failed"}), text
        assert "too high" in text
        # A step that does not end: at its time limit, and when the command is interrupted.
        gate = library / "gate" / "gate.v"
        gate.write_text("module gate;\n  initial forever #1;\nendmodule\n")
        endless = ("acme:m:gate", "--target", "sim_icarus", "--cluster", machines)
        status, text = run(library, *endless, "--timeout", "10", name="build", **remote)
        assert (status, "ended at the time limit of 10 s" in text) == (1, True), text
        wait_until(lambda: not simulations(library))
        running = subprocess.Popen(
            command(*endless, name="build"),
            cwd=library,
            env=environment(library, **remote),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_until(lambda: simulations(library))
        running.send_signal(signal.SIGINT)
        assert running.wait() == 130
        wait_until(lambda: not simulations(library))


@pytest.mark.check
@pytest.mark.xdist_group("dask")
@needs_openssl
@pytest.mark.skipif(not can_sandbox(), reason="bwrap is not installed or not permitted")
def test_a_cluster_behind_tls_without_a_shared_folder(
    library: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Scheduler, workers and command have certificates of one authority; without one, the command is refused."""
    distributed = pytest.importorskip("distributed", reason="no distributed; make test installs it")
    folder = tmp_path_factory.mktemp("certificates")
    write_certificates(folder)
    files = tls_files(folder, "node", "ca")
    names = {
        f"DASK_DISTRIBUTED__COMM__TLS__{name.replace('.', '__').replace('-', '_').upper()}": name for name in files
    }
    for variable, name in names.items():
        monkeypatch.setenv(variable, files[name])
    keys = {f"distributed.comm.tls.{name}": value for name, value in files.items()}
    token = {"FUSESOC_FIRM_REMOTE_TOKEN": SECRET}
    with (
        importlib.import_module("dask").config.set(keys),
        workers_apart(tmp_path, "tls://", distributed.Security(require_encryption=True)) as address,
        served(Server(Store(library.parent / "server", 2**30), "127.0.0.1", 0, SECRET)) as url,
    ):
        assert address.startswith("tls://")
        selected = ("acme:m:gate", "--target", "sim_icarus", "--cluster", address)
        status, text = run(library, *selected, name="build", FUSESOC_FIRM_REMOTE=url, **token)
        assert (status, results(text)) == (0, {"sim_icarus": "ok"}), text
        assert "warning" not in text
        assert os.access(library / "build" / "acme_m_gate_1.0" / "sim_icarus" / "acme_m_gate_1.0", os.X_OK)
        for variable in names:
            monkeypatch.delenv(variable)
        status, text = run(library, *selected, name="build", FUSESOC_FIRM_REMOTE=url, **token)
        assert (status, "requires distributed.comm.tls.ca-file" in text) == (1, True), text


LOCKED = """\
CAPI=2:
name: acme:m:locked:1.0
filesets: {base: {depend: ["robot:firm:generators", "acme:m:counter"]}}
generate: {one: {generator: firm, parameters: {message: std_msgs/Header, ros: 2, width: 32}}}
targets:
  lint:
    filesets: [base]
    generate: [one]
    toplevel: axis_to_std_msgs_header
    flow: lint
    flow_options: {tool: verilator, frontends: [ghdlsynth]}
"""


@pytest.mark.check
@pytest.mark.skipif(not can_sandbox(), reason="bwrap is not installed or not permitted")
def test_two_machines_with_one_lock_give_the_same_bytes(library: Path, tmp_path: Path) -> None:
    """The second machine has a copy of the project, lock file included, an empty store and its own temporary files."""
    (library / "locked.core").write_text(LOCKED)
    with (library / "fusesoc.conf").open("a") as conf:
        conf.write(f"[library.firm]\nlocation = {library_root()}\n")
    arguments = ("acme:m:locked", "--target", "lint", "--locked", "--build-only", "--cached")
    status, text = run(library, "acme:m:locked", "--locked", name="lock")
    assert (status, "locked.lock" in text) == (1, True), text
    assert run(library, "acme:m:locked", name="lock")[0] == 0
    second = tmp_path / "second"
    shutil.copytree(library, second)
    assert run(library, *arguments, name="build")[0] == 0
    first = outputs(library)
    assert any(path.suffix == ".v" for path in first)
    shutil.rmtree(library / "build")
    # At the same path, since GHDL's libraries contain it. The checkout may be a temporary folder, too.
    places = ("--ro-bind", "/", "/", "--dev", "/dev", "--proc", "/proc", "--tmpfs", "/tmp")
    checkout = ("--ro-bind", str(REPOSITORY), str(REPOSITORY), "--bind")
    done = subprocess.run(
        ["bwrap", *places, *checkout, str(second), str(library), "--unshare-net", *command(*arguments, name="build")],
        cwd=library,
        env=environment(library, FUSESOC_FIRM_CACHE=str(library / "store")),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, results(done.stdout)) == (0, {"lint": "ok"}), done.stdout + done.stderr
    (second / "build").rename(library / "build")
    assert outputs(library) == first
    # Another file of a dependency is another build, which the lock does not accept.
    (library / "counter" / "counter.vhd").write_text(FILES["counter/counter.vhd"] + "-- edited\n")
    status, text = run(library, *arguments, name="build")
    assert (status, "acme:m:counter" in text) == (1, True), text


def simulations(library: Path) -> list[str]:
    """Return the ids of running simulations of Icarus Verilog in builds of a library, also of other machines."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if b"vvp" in (process / "cmdline").read_bytes() and str(library) in str((process / "cwd").readlink()):
                found.append(process.name)
    return found


def test_a_first_run_is_noted_although_it_generated_a_core(library: Path) -> None:
    """A call of our generator that FuseSoC starts as a process, since it is not in the store."""
    with (library / "fusesoc.conf").open("a") as file:
        file.write(f"[library.firm]\nlocation = {library_root()}\n")
    (library / "made").mkdir()
    (library / "made" / "made.core").write_text(
        """\
CAPI=2:
name: acme:m:made:1.0
filesets: {base: {depend: ["robot:firm:generators"]}}
generate: {one: {generator: firm, parameters: {message: std_msgs/Bool, ros: 2, direction: subscriber, width: 32}}}
targets:
  sim_made: {filesets: [base], generate: [one], toplevel: axis_to_std_msgs_bool, default_tool: ghdl}
"""
    )
    selected = ("acme:m:made",)
    assert not is_recalled(library, *selected)
    assert is_recalled(library, *selected)
