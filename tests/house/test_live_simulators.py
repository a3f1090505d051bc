"""A live simulator of a system sends the same response bytes as the bench that reads frames from files."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from fusesoc_firm import __version__
from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.engine.bursts import BurstJoiner
from fusesoc_firm.node.transport.built_simulator import BuiltSimulator, CoreSources, build_simulator
from fusesoc_firm.node.transport.simulator import Simulator, Waits
from fusesoc_firm.node.transport.transport import Burst
from fusesoc_firm.studio.page_run import stimuli_of
from fusesoc_firm.system.hardware.waits import waits_configuration
from fusesoc_firm.system.message_sources import core_of, load_beside
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.simulators import fitting
from tests.house.test_main_job import ROOT, run

SPECS = ROOT / "specs"
# The number of publishers and the width of each: one message; bursts of three types and rates; images.
SYSTEMS = {"quat2euler": (1, 8), "multi_type": (3, 64), "image_pipeline": (1, 128)}
STALL_PERCENT = 25  # the default of the bench that reads files


@pytest.fixture(scope="module")
def build_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("live") / "build"


@pytest.fixture(scope="module")
def specs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folders of the systems, whose models run for less time than a compilation with optimisation takes."""
    folder = tmp_path_factory.mktemp("specs")
    for system in SYSTEMS:
        copy_of(system, folder, has_core=True)
    return folder / "some place"


@pytest.fixture(scope="module", params=SYSTEMS)
def recorded(request: pytest.FixtureRequest, build_root: Path) -> tuple[str, Path]:
    """A system, and the folder with the files of a run of its bench."""
    done = run(request.param, build_root)
    assert done.returncode == 0, done.stdout
    return request.param, build_root / f"robot_sys_{request.param}_{__version__}" / "sim"


def frames_of(file: Path) -> list[bytes]:
    """The frames in a stimulus file, or in a file of received frames."""
    frames: list[bytearray] = []
    for line in file.read_text().splitlines():
        if line.startswith((">", "<")):
            frames.append(bytearray())
        elif line and not line.startswith(("#", "!")):
            frames[-1] += bytes.fromhex(line)
    return list(map(bytes, frames))


def by_id(frames: Iterable[bytes]) -> dict[int, list[bytes]]:
    found: dict[int, list[bytes]] = {}
    for frame in frames:
        found.setdefault(frame[0], []).append(frame)
    return found


def answers(built: BuiltSimulator, frames: list[bytes], shape: tuple[int, int], count: int) -> tuple[list[bytes], int]:
    """The frames of a system's responses, in order, and the cycle of the last beat; so many are expected."""
    joiner, last = BurstJoiner(*shape), 0
    joined: list[bytes] = []
    with Simulator(built.command(seed=1, stall_percent=STALL_PERCENT), built.folder) as simulator:
        for frame in frames:
            simulator.request(frame)
        simulator.run(1)
        while simulator.quiet < (2_000 if len(joined) >= count else 100_000):
            for event in simulator.run(1_000):
                if isinstance(event, Burst):
                    last = event.last_cycle or 0
                    if frame_ := joiner.push(event.data, event.tid):
                        joined.append(bytes([frame_.id]) + len(frame_.payload).to_bytes(4, "little") + frame_.payload)
        simulator.quit()
    joiner.close()
    return joined, last


@pytest.mark.check
def test_the_same_frames_give_the_same_bytes(recorded: tuple[str, Path], specs: Path, build_root: Path) -> None:
    system, folder = recorded
    stimuli, received = frames_of(folder / "stimulus.txt"), frames_of(folder / "received.txt")
    ends = []
    for tool in filter(shutil.which, fitting(is_live=True)):
        built = build_simulator(specs / system / f"{system}.yaml", tool, build_root=build_root.parent / "simulators")
        found, last = answers(built, stimuli, SYSTEMS[system], len(received))
        assert by_id(found) == by_id(received)
        ends.append(last)
    assert len(received) >= 7
    # Both simulators stall in the same cycles.
    assert len(set(ends)) == 1


@pytest.mark.check
@pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")
def test_a_second_build_builds_nothing(specs: Path, build_root: Path) -> None:
    spec, root = specs / "quat2euler" / "quat2euler.yaml", build_root.parent / "simulators"
    first = build_simulator(spec, "verilator", build_root=root)
    time = Path(*first.words).stat().st_mtime_ns
    assert build_simulator(spec, "verilator", build_root=root) == first
    assert Path(*first.words).stat().st_mtime_ns == time


def copy_of(application: str, folder: Path, *, has_core: bool) -> Path:
    """A copy of a specification in a new folder; GCC optimises nothing."""
    copy = folder / "some place" / application
    shutil.copytree(SPECS / application, copy)
    for core in copy.glob("*.core"):
        if has_core:
            core.write_text(core.read_text().replace("OPT_FAST=-O2", "OPT_FAST=-O0"))
        else:
            core.unlink()
    return copy / f"{application}.yaml"


@pytest.mark.check
def test_a_specification_without_a_core(tmp_path: Path) -> None:
    spec = copy_of("quat2euler", tmp_path, has_core=False)
    sources = CoreSources(depend=["robot:acc:firm_cordic", "robot:acc:firm_float64"])
    built = build_simulator(spec, build_root=tmp_path / "build", sources=sources)
    frame = quaternion()
    assert len(answers(built, [frame], (1, 8), 1)[0]) == 1
    # It leaves nothing next to the specification.
    assert not [*spec.parent.glob("*.core")]


def quaternion() -> bytes:
    return b"\x00\x20\x00\x00\x00" + bytes(24) + b"\x00\x00\x00\x00\x00\x00\xf0\x3f"


@pytest.mark.check
@pytest.mark.parametrize(
    ("tool", "changes"),
    [
        ("ghdl", {"  name: quat2euler\n": "  name: quat2euler\n  interconnect: uart\n  clock: 100 MHz\n"}),
        ("verilator", {"  name: quat2euler\n": "  name: quat2euler\n  interconnect: uart\n  clock: 10 MHz\n"}),
        ("verilator", {"  name: quat2euler\n": "  name: quat2euler\n  interconnect: spi\n"}),
        (
            "ghdl",
            {
                "  fpgaPart: xc7z020clg400-1\n": "  clock: 100 MHz\n  clocks: [{name: fast, frequency: 150 MHz}]\n",
                "    type: quat2euler\n": "    type: quat2euler\n    clock: fast\n",
            },
        ),
    ],
    ids=["uart", "uart_verilator", "spi_verilator", "clocks"],
)
def test_links_and_further_clocks(tmp_path: Path, tool: str, changes: dict[str, str]) -> None:
    if shutil.which(tool) is None:
        pytest.skip(f"{tool} is not installed")
    spec = copy_of("quat2euler", tmp_path, has_core=True)
    text = spec.read_text()
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new, 1)
    spec.write_text(text)
    built = build_simulator(spec, tool, build_root=tmp_path / "build")
    found, _ = answers(built, [quaternion()] * 3, (1, 8), 3)
    # Roll, pitch and yaw of the identity rotation.
    assert found == [b"\x00\x18\x00\x00\x00" + bytes(24)] * 3


@pytest.mark.check
def test_a_changed_source_is_built_and_its_fault_shown(tmp_path: Path) -> None:
    spec = copy_of("quat2euler", tmp_path, has_core=True)
    build_simulator(spec, build_root=tmp_path / "build")
    source = next(spec.parent.glob("rtl/*.vhd"))
    right = source.read_text()
    source.write_text(right.replace("begin", "begin nonsense", 1))
    with pytest.raises(InputError, match=r"cannot build(.|\n)*quat2euler\.vhd:\d+:\d+"):
        build_simulator(spec, build_root=tmp_path / "build")
    source.write_text(right)
    assert build_simulator(spec, build_root=tmp_path / "build").folder.is_dir()


def test_the_core_beside_it_is_the_one_that_names_it() -> None:
    core = core_of(SPECS / "quat2euler" / "quat2euler_hls.yaml")
    assert core and core.path == SPECS / "quat2euler" / "quat2euler_hls.core"
    assert core_of(SPECS / "quat2euler" / "stimuli.yaml") is None


def test_what_cannot_be_built_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="there is no specification"):
        build_simulator(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="unknown simulator 'questa' for live systems"):
        build_simulator(SPECS / "quat2euler" / "quat2euler.yaml", "questa")
    with pytest.raises(InputError, match="is for verilator"):
        build_simulator(SPECS / "multi_type" / "multi_type_verilog.yaml", build_root=tmp_path / "build")
    old = copy_of("quat2euler", tmp_path, has_core=True)
    core = old.with_suffix(".core")
    core.write_text(core.read_text().replace("\n  live:", "\n  alive:"))
    with pytest.raises(InputError, match=r"has no target 'live'(.|\n)*firm system core"):
        build_simulator(old, build_root=tmp_path / "build")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python3"))
    with pytest.raises(
        InputError, match=r"missing programs: ghdl, make(.|\n)*apt-get install --no-install-recommends ghdl"
    ):
        build_simulator(SPECS / "quat2euler" / "quat2euler.yaml")


def test_the_command_prints_a_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = copy_of("quat2euler", tmp_path, has_core=True)
    options = ["--build-root", str(tmp_path / "a b"), "--seed", "7", "--stall-percent", "30"]
    assert main(["simulator", str(spec), *options]) == 0
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    # As a shell and another program read it.
    echoed = subprocess.run(["/bin/sh", "-c", f"echo {printed}"], capture_output=True, text=True, check=True)
    assert shlex.split(printed) == [echoed.stdout.rstrip("\n")]
    with Simulator(shlex.split(printed)) as simulator:
        simulator.request(quaternion())
        while not any(isinstance(event, Burst) for event in simulator.run(1000)):
            assert simulator.quiet < 1000
        simulator.quit()
    with pytest.raises(SystemExit):
        main(["simulator", str(spec), "--seed", "0"])
    assert "0 is not a whole number from 1 to 2147483562" in capsys.readouterr().err


def levels_of(waves: Path, unit: str) -> Iterator[dict[str, str]]:
    """The levels of the signals in a unit before each rising edge of its clk, by name or `name[bit]`."""
    names: dict[str, list[tuple[str, int, int]]] = {}
    scopes: list[str] = []
    before: dict[str, str] = {}
    now: dict[str, str] = {}
    with waves.open(encoding="utf-8") as lines:
        for line in lines:
            words = line.split()
            if line.startswith("$scope"):
                scopes.append(words[2])
            elif line.startswith("$upscope"):
                scopes.pop()
            elif line.startswith("$var") and scopes[-1] == unit:
                name, _, bounds = "".join(words[4:-1]).partition("[")
                high, _, low = bounds.rstrip("]").partition(":")
                names.setdefault(words[3], []).append((name.lower(), int(high or 0), int(low or high or 0)))
            elif line.startswith("#"):
                if now.get("clk") == "1" and before.get("clk") == "0":
                    yield dict(before)
                before |= now
            elif words and not line.startswith("$"):
                value, code = (words[0][1:], words[1]) if line.startswith("b") else (line[0], line[1:].strip())
                for name, first, last in names.get(code, ()):
                    bits = value.rjust(first - last + 1, "0")[::-1]
                    now |= {f"{name}[{last + place}]" if first > last else name: bit for place, bit in enumerate(bits)}


@pytest.mark.check
@pytest.mark.parametrize("system", ["quat2euler", "multi_type"])
def test_waits_are_those_of_the_waves(system: str, specs: Path, tmp_path: Path, build_root: Path) -> None:
    """They are counted here in GHDL's waves of a run; all simulators count the same."""
    spec, counted = specs / system / f"{system}.yaml", []
    loaded = load_beside(spec)
    ids = {item.block: item.id for item in loaded.system.subscribers}
    frames = [pack_frame(ids[item.subscriber.block], item.payload) for item in stimuli_of(spec, loaded)[:12]]
    for tool in filter(shutil.which, fitting(is_live=True)):
        built = build_simulator(spec, tool, build_root=build_root.parent / "simulators")
        command = built.command(seed=3, stall_percent=STALL_PERCENT)
        command += [f"--vcd={tmp_path / 'waves.vcd'}"] * (tool == "ghdl")
        with Simulator(command, built.folder) as simulator:
            simulator.request_waits()
            for frame in frames:
                simulator.request(frame)
            simulator.run(1)
            while simulator.quiet < 1000:
                simulator.run(1000)
            simulator.request_waits()
            counted += simulator.run(0)
            simulator.quit()
    assert counted == counted[:1] * len(counted)
    (waits,) = counted[:1]
    assert isinstance(waits, Waits)
    edges = [*levels_of(tmp_path / "waves.vcd", "u_system")][-waits.cycle :]
    expected = []
    for row in waits_configuration(loaded.system)["wires"]:
        pairs = [(item["verilog_valid"], item["verilog_ready"]) for item in row["handshakes"]]
        expected.append(sum(any(now[valid] == "1" and now[ready] == "0" for valid, ready in pairs) for now in edges))
    assert [*waits.counts[2:]] == expected
    assert max(expected) > 100
