"""`firm message verify` finds what is broken: converters, layout, judge, handshakes, a simulation that hangs."""

from __future__ import annotations

import functools
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.core.request import GeneratedFile
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Fixed, Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.verify import command, simulation, task
from fusesoc_firm.runs.verify.campaign import Entry
from fusesoc_firm.runs.verify.complexity import statistics
from fusesoc_firm.runs.verify.definitions import NoJudgementError
from fusesoc_firm.runs.verify.judge import Judgement, judge
from fusesoc_firm.runs.verify.task import Result, Task, Verdict, verify
from fusesoc_firm.tools import workers
from fusesoc_firm.tools.workers import Workers
from tests.hdl.ghdl import CORES, REPOSITORY, Library
from tests.processes import IGNORING_INTERRUPTS
from tests.runs.verify.messages import standard

Captured = pytest.CaptureFixture[str]
Files = Callable[[Iterable[Frame], int], dict[str, GeneratedFile]]

POINT = "geometry_msgs/Point"
DEAF = (
    "s_axis_tready <= '0'; x <= x_r; y <= x_r; z <= x_r; segment_valid <= \"0\"; msg_valid <= '0'; frame_error <= '0';"
)


def result(ros: int = 2, name: str = POINT, width: int = 8) -> Result:
    message, definitions = standard(ROS2 if ros == 2 else ROS1, name)
    return verify(Task(message, definitions, width, stimuli=3, seed=1, keeps_files=True))


def other_frame(monkeypatch: pytest.MonkeyPatch, which: str, change: Callable[[Frame], Frame]) -> None:
    """Make one of the converters of another frame than the message's."""
    files: Files = getattr(task, which)
    monkeypatch.setattr(task, which, lambda frames, width: files([change(frame) for frame in frames], width))


def other_text(monkeypatch: pytest.MonkeyPatch, which: str, change: Callable[[str], str]) -> None:
    """Change the VHDL of one of the converters."""
    files: Files = getattr(task, which)

    def changed(frames: Iterable[Frame], width: int) -> dict[str, GeneratedFile]:
        return {name: replace(file, content=change(str(file.content))) for name, file in files(frames, width).items()}

    monkeypatch.setattr(task, which, changed)


def architecture(declarations: str, statements: str) -> Callable[[str], str]:
    """Put another architecture behind the entity's declaration."""

    def change(text: str) -> str:
        entity, end, _ = text.partition("end entity;\n")
        name = entity.partition("entity ")[2].split()[0]
        assert end
        return (
            f"{entity}{end}\narchitecture broken of {name} is\n{declarations}\nbegin\n{statements}\nend architecture;\n"
        )

    return change


def with_swapped_fields(frame: Frame) -> Frame:
    (node,) = frame.nodes
    assert isinstance(node, Fixed)
    first, second, *rest = node.fields
    return replace(
        frame,
        nodes=(replace(node, fields=(replace(first, runs=second.runs), replace(second, runs=first.runs), *rest)),),
    )


def with_a_gap(frame: Frame) -> Frame:
    (node,) = frame.nodes
    assert isinstance(node, Fixed)
    return replace(frame, nodes=(replace(node, size=node.size + 8),))


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("ros", [1, 2])
def test_right_converters_pass(ros: int, width: int) -> None:
    found = result(ros, width=width)
    assert (found.verdict, found.detail, found.files) == (Verdict.PASS, "", {})
    assert found.payload_bytes == ((24, 24, 24) if ros == 1 else (28, 28, 28))
    assert found.cycles > 3 * 28 / (width / 8)


@pytest.mark.parametrize("which", ["subscriber_files", "publisher_files"])
def test_a_converter_that_takes_fields_for_each_other_fails(monkeypatch: pytest.MonkeyPatch, which: str) -> None:
    other_frame(monkeypatch, which, with_swapped_fields)
    found = result()
    assert found.verdict is Verdict.FAIL
    assert "expected" in found.detail and "got" in found.detail
    assert set(found.files) >= {"loop.vhd", "stimulus.txt", "expected.txt", "output.txt"}


def test_a_layout_that_takes_fields_for_each_other_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both converters have it from there, so what comes out of the loop is right."""
    monkeypatch.setattr(task, "frame_of", lambda *arguments: with_swapped_fields(frame_of(*arguments)))
    found = result()
    assert found.verdict is Verdict.FAIL
    assert found.detail.startswith("the layout differs from the reference's: byte ")


@pytest.mark.parametrize("which", ["subscriber_files", "publisher_files"])
def test_a_converter_of_another_length_fails(monkeypatch: pytest.MonkeyPatch, which: str) -> None:
    other_frame(monkeypatch, which, with_a_gap)
    assert result().verdict is Verdict.FAIL


@pytest.mark.parametrize("byte", [2, 4, 20])
def test_a_wrong_byte_of_the_judge_fails(monkeypatch: pytest.MonkeyPatch, byte: int) -> None:
    def wrong(*arguments: object) -> Judgement:
        judgement = judge(*arguments)  # type: ignore[arg-type]
        payload = bytearray(judgement.payloads[1])
        payload[byte] ^= 0x10
        return replace(judgement, payloads=(judgement.payloads[0], bytes(payload), *judgement.payloads[2:]))

    monkeypatch.setattr(task, "judge", wrong)
    assert result().verdict is Verdict.FAIL


def test_vhdl_that_does_not_compile_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    other_text(monkeypatch, "publisher_files", lambda text: text.replace("end architecture;", "nonsense;"))
    found = result()
    assert found.verdict is Verdict.FAIL
    assert found.detail.startswith("geometry_msgs_point_to_axis.vhd:")


def test_a_generator_that_stumbles_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task, "publisher_files", lambda frames, width: 1 // 0)
    assert result().detail == "not converted: ZeroDivisionError: integer division or modulo by zero"


def test_hardware_that_hangs_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    signals = "signal x_r : std_logic_vector(63 downto 0);"
    other_text(monkeypatch, "subscriber_files", architecture(signals, DEAF))
    found = result()
    assert found.verdict is Verdict.FAIL
    assert found.detail.startswith("nothing moved for 5000 cycles; 0 of 3 frames in, 0 of 3 out")


def test_a_simulation_that_does_not_end_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    forever = f"{DEAF}\nprocess begin loop null; end loop; end process;"
    other_text(monkeypatch, "subscriber_files", architecture("signal x_r : std_logic_vector(63 downto 0);", forever))
    monkeypatch.setattr(task, "simulate", functools.partial(simulation.simulate, timeout=2))
    found = result()
    assert (found.verdict, found.detail) == (Verdict.FAIL, "the simulation did not end within 2 s")


def test_a_message_that_is_withdrawn_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """`segment_valid` must stay until `msg_ready`; the publisher's stream falls with it, and is checked first."""
    blink = f"valid_r <= rst_n and not valid_r when rising_edge(clk);\n{DEAF}".replace('"0"', "(others => valid_r)")
    signals = "signal x_r : std_logic_vector(63 downto 0);\nsignal valid_r : std_logic := '0';"
    other_text(monkeypatch, "subscriber_files", architecture(signals, blink))
    found = result()
    assert found.detail == "firm_axis_checker: from the publisher: stable: tvalid fell before tready"


def test_an_error_that_is_told_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    always = functools.partial(re.sub, r"\bframe_error +<= [^;]+;", "frame_error <= '1';")
    other_text(monkeypatch, "subscriber_files", always)
    assert "frame_error(0) pulses, announced: 0" in result().detail


# --- the gates ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def gates(tmp_path_factory: pytest.TempPathFactory) -> Library:
    library = Library("firm", tmp_path_factory.mktemp("gates"))
    library.analyse([CORES / "sim/rtl/firm_sim_gates.vhd", CORES / "sim/tb/firm_sim_gates_tb.vhd"])
    return library


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", [1, 2, 77])
@pytest.mark.parametrize("percent", [0, 30, 90])
def test_gates_stall_and_withdraw_nothing(gates: Library, seed: int, percent: int) -> None:
    found = gates.run("firm_sim_gates_tb", {"SEED": seed, "STALL_PERCENT": percent})
    assert found.exit_code == 0, found.output
    closed = [int(line.rpartition(" ")[2]) for line in found.output.splitlines() if " closed " in line]
    assert len(closed) == 3
    # Gate 0 is never asked, so it stays as it was drawn; gate 1 is drawn anew in every cycle.
    assert closed[0] < 10 or closed[0] > 9990
    assert abs(closed[1] - 100 * percent) < 300


def test_a_source_that_withdraws_is_found(gates: Library) -> None:
    found = gates.run("firm_sim_gates_tb", {"WITHDRAWS": True})
    assert found.exit_code != 0
    assert "firm_sim_gates: valid(1) falls before ready rises" in found.output


# --- the command -------------------------------------------------------------------------------------------------


def test_the_command_reports(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "report.json"
    names = ["geometry_msgs/Po?nt", "geometry_msgs/Vector3", "std_msgs/Empty"]
    command = ["message", "verify", *names, "--ros", "1", "--report", str(path), "--width", "64", "--jobs", "1"]
    assert main(command) == 0
    assert "3 messages in" in capsys.readouterr().out
    data = json.loads(path.read_text())
    assert [(each["name"], each["verdict"], each.get("same_as")) for each in data["messages"]] == [
        ("geometry_msgs/Point", "pass", None),
        ("geometry_msgs/Vector3", "pass", "geometry_msgs/Point"),
        ("std_msgs/Empty", "pass", None),
    ]
    for text in (path.read_text(), path.with_suffix(".html").read_text()):
        assert str(tmp_path) not in text and str(REPOSITORY) not in text


def test_the_command_prints_the_report_as_json(capsys: Captured) -> None:
    assert main(["message", "verify", "std_msgs/Empty", "--jobs", "1", "--stimuli", "1", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert (data["totals"]["pass"], data["messages"][0]["name"]) == (1, "std_msgs/Empty")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["geometry_msgs/Piont"], "unknown message 'geometry_msgs/Piont'"),
        (["nowhere/*"], "no message matches 'nowhere/*'"),
        (["std_msgs/Bool", "--width", "7"], "converters do not support 7-bit streams"),
        (["std_msgs/Bool", "--cluster", "tcp://127.0.0.1:1"], "no Dask scheduler responds|the package 'distributed'"),
    ],
)
def test_what_cannot_be_done_is_said(
    arguments: list[str], words: str, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "_CONNECT_SECONDS", 1)
    assert main(["message", "verify", *arguments]) == 1
    error = capsys.readouterr().err
    assert any(word in error for word in words.split("|"))
    assert "Traceback" not in error


def test_without_ghdl_it_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Captured) -> None:
    simulation.ghdl.cache_clear()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["message", "verify", "std_msgs/Bool"]) == 1
    assert "GHDL is not installed" in capsys.readouterr().err


def in_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """The workers are threads here, so that they share what a test breaks."""

    @contextmanager
    def threads(_: int | None = None) -> Iterator[Workers]:
        with ThreadPoolExecutor(2) as executor:
            yield Workers(executor, 2)

    monkeypatch.setattr(workers, "local_workers", threads)


def test_a_message_without_a_judge_is_no_success(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> NoReturn:
        raise NoJudgementError("nobody knows it")

    in_threads(monkeypatch)
    monkeypatch.setattr(task, "judge", refuse)
    assert main(["message", "verify", "std_msgs/Bool"]) == 1
    captured = capsys.readouterr()
    assert "no judge: std_msgs/Bool: nobody knows it" in captured.out
    assert "no message could be verified" in captured.err


def test_wstrings_are_verified(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "a_msgs").mkdir()
    (tmp_path / "a_msgs" / "Wide.msg").write_text("uint8 a\nwstring w\nwstring[2] x\nwstring<=3[] y\nfloat64 z\n")
    assert main(["message", "verify", "a_msgs/Wide", "--path", str(tmp_path), "--jobs", "1"]) == 0
    assert "1 pass" in capsys.readouterr().out


def test_a_failure_is_kept_and_can_be_repeated(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Captured
) -> None:
    in_threads(monkeypatch)
    other_frame(monkeypatch, "publisher_files", with_swapped_fields)
    arguments = ["--ros", "1", "--width", "16", "--stimuli", "4", "--seed", "6"]
    assert main(["message", "verify", "geometry_msgs/Point", *arguments, "--keep", str(tmp_path)]) == 1
    captured = capsys.readouterr()
    assert f"to repeat: firm message verify {' '.join(arguments)} geometry_msgs/Point" in captured.out
    assert "1 of 1 messages failed" in captured.err
    kept = tmp_path / "ros1_geometry_msgs_Point"
    assert "FAIL" in (kept / "output.txt").read_text()
    assert "entity firm_verify_loop" in (kept / "loop.vhd").read_text()


def test_ctrl_c_ends_it_at_once(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "TMPDIR": str(tmp_path)}
    running = subprocess.Popen(
        [*IGNORING_INTERRUPTS, sys.executable, "-m", "fusesoc_firm.cli", "message", "verify", "--ros", "1"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    while not list(tmp_path.glob("firm_verify_*")):
        time.sleep(0.05)
    os.killpg(running.pid, signal.SIGINT)
    output, _ = running.communicate()
    assert running.returncode == 130
    assert output.strip().splitlines()[-1] == "interrupted"
    assert "Traceback" not in output
    assert list(tmp_path.iterdir()) == []


def test_the_same_message_gets_the_same_stimuli_in_any_company() -> None:
    library = MessageLibrary(ROS1)
    name = parse_name(POINT)
    tasks = [Task(name, library.closure(name), width, 3, 5) for width in (8, 64)]
    assert tasks[0].chance().random() == tasks[1].chance().random()
    assert tasks[0].chance().random() != replace(tasks[0], seed=6).chance().random()


@pytest.mark.check
def test_a_dask_cluster_gives_the_same(tmp_path: Path, capsys: Captured) -> None:
    distributed = pytest.importorskip("distributed", reason="distributed is not installed")
    arguments = ["message", "verify", "geometry_msgs/P*", "--ros", "1"]
    reports = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path)
    ) as cluster:
        for where in (["--cluster", cluster.scheduler_address], ["--jobs", "2"]):
            path = tmp_path / "report.json"
            main([*arguments, *where, "--report", str(path)])
            messages = json.loads(path.read_text())["messages"]
            reports.append([{key: value for key, value in each.items() if key != "seconds"} for each in messages])
    assert reports[0] == reports[1]
    assert {each["verdict"] for each in reports[0]} >= {"pass"}


def test_a_campaign_continues_after_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Captured
) -> None:
    """The verdicts until then are in the report, and are kept if the definitions are the same."""
    folder = tmp_path / "a_msgs" / "msg"
    folder.mkdir(parents=True)
    for name in "ABC":
        (folder / f"{name}.msg").write_text(f"uint8 {name.lower()}\n")
    report, verified = tmp_path / "report.json", list[str]()

    def pretend(_: MessageLibrary, names: Iterable[MessageName], *_others: object) -> Iterator[Entry]:
        for name in names:
            if name.name == "C" and not verified:
                raise KeyboardInterrupt
            definitions = MessageLibrary(ROS2, [tmp_path]).closure(name)
            measures, signed = statistics(name, definitions), signature(name, definitions)
            yield Entry(name, ROS2, Result(Verdict.PASS, seconds=1.0), measures, None, signed)

    monkeypatch.setattr(command, "run", pretend)
    in_threads(monkeypatch)
    arguments = ["message", "verify", "a_msgs/*", "a_msgs/Missing", "--path", str(tmp_path), "--report", str(report)]
    assert main(arguments) == 130
    captured = capsys.readouterr()
    assert "unknown message 'a_msgs/Missing'" in captured.err
    assert "2 of 3 messages were verified; --resume continues" in captured.err
    assert [item["name"] for item in json.loads(report.read_text())["messages"]] == ["a_msgs/A", "a_msgs/B"]
    (folder / "B.msg").write_text("uint16 b\n")
    verified.append("again")
    kept: list[list[str]] = []

    def noted(library: MessageLibrary, names: Iterable[MessageName], *others: object) -> Iterator[Entry]:
        kept.append([str(name) for name in names])
        return pretend(library, [parse_name(name) for name in kept[-1]], *others)

    monkeypatch.setattr(command, "run", noted)
    assert main([*arguments, "--resume"]) == 1
    captured = capsys.readouterr()
    assert kept == [["a_msgs/B", "a_msgs/C"]]
    assert "3 of 3 messages, 0 failed" in captured.err
    assert "the names above are unknown or invalid" in captured.err
    assert json.loads(report.read_text())["totals"]["pass"] == 3
    assert main([*arguments, "--resume", "--width", "16"]) == 1
    assert "report.json has other width" in capsys.readouterr().err
