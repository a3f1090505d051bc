"""The host at the end of a pipe, in VHDL and in SystemVerilog: what it does for requests, and how it ends."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from fusesoc_firm.node.transport.simulator import ErrorPulse, Event, Simulator, Taken, Waits
from fusesoc_firm.node.transport.transport import Burst, TransportError
from tests.cores.pipes import TOOLS, PipeBench, pipe_bench
from tests.hdl.frames import random_frames
from tests.seeds import seeded

SEED = seeded(20240611)
EVERY_BYTE = bytes(range(256))
VERSION = b"V\5"
FRAME = b"\x07\x04\x00\x00\x00\x00\x0a\xff\x0d"


# Verilator has to build a program for each width; that it does as the others is for all tests to see.
@pytest.fixture(scope="module", params=["ghdl", "icarus", pytest.param("verilator", marks=pytest.mark.check)])
def bench(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> PipeBench:
    return pipe_bench(request.param, tmp_path_factory.mktemp("pipe"))


def run_to_rest(simulator: Simulator, rest: int = 300) -> list[Event]:
    events = simulator.run(1)
    while simulator.quiet < rest:
        events += simulator.run(rest)
    return events


def run_to_burst(simulator: Simulator) -> None:
    while not any(isinstance(event, Burst) for event in simulator.run(1000)):
        pass


def send_all(simulator: Simulator, frames: list[bytes], seed: int) -> list[Event]:
    """Request frames at random times, and run until nothing happens any more."""
    chance = random.Random(seed)
    events: list[Event] = []
    for frame in frames:
        simulator.request(frame)
        if chance.random() < 0.3:
            events += simulator.run(chance.randrange(200))
    return events + run_to_rest(simulator)


@pytest.mark.one_in(5)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("stall", [0, 40, 90])
def test_frames_there_and_back(bench: PipeBench, width: int, stall: int) -> None:
    print(f"seed {SEED}, width {width}, stalls {stall} %")
    frames = [EVERY_BYTE, *(frame.to_bytes() for frame in random_frames(range(4), 40, 60, SEED))]
    with bench.start(width, SEED=SEED, STALL_PERCENT=stall) as simulator:
        events = send_all(simulator, frames, SEED)
        simulator.quit()
    bursts = [event for event in events if isinstance(event, Burst)]
    taken = [event for event in events if isinstance(event, Taken)]
    assert [burst.data for burst in bursts] == frames
    assert [burst.tid for burst in bursts] == [frame[0] for frame in frames]
    # The wire hands a beat on in the cycle in which it takes it.
    assert [(burst.first_cycle, burst.last_cycle) for burst in bursts] == [
        (item.first_cycle, item.last_cycle) for item in taken
    ]
    for frame, item in zip(frames, taken, strict=True):
        beats = -(-len(frame) * 8 // width)
        cycles = item.last_cycle - item.first_cycle + 1
        assert cycles == beats if stall == 0 else cycles >= beats
    assert len(events) == 2 * len(frames)


def test_all_simulators_do_the_same_in_every_cycle(tmp_path: Path) -> None:
    frames = [frame.to_bytes() for frame in random_frames(range(4), 30, 60, SEED)]
    found = []
    for tool in TOOLS:
        (tmp_path / tool).mkdir()
        bench = pipe_bench(tool, tmp_path / tool)
        for seed in (1, SEED, 2147483562):
            print(f"seed {seed}, {tool}")
            with bench.start(8, SEED=seed, STALL_PERCENT=47) as simulator:
                found.append((seed, send_all(simulator, frames, SEED), simulator.cycle))
    assert found[3:] == found[:3] * (len(TOOLS) - 1)
    assert found[0][1] != found[1][1]


def test_the_same_requests_have_the_same_reports(bench: PipeBench) -> None:
    runs = []
    for pause in (0.0, 0.2):
        with bench.start(8, SEED=SEED, STALL_PERCENT=30) as simulator:
            simulator.request(FRAME)
            events = simulator.run(3)
            # Nothing happens while nobody asks for it.
            time.sleep(pause)
            runs.append((events + run_to_rest(simulator), simulator.cycle))
    assert runs[0] == runs[1]


def test_waits_are_counted_from_the_first_request_on(bench: PipeBench) -> None:
    """The system is a wire: a beat waits in the same cycles in both streams of the host, and at its ends."""
    print(f"seed {SEED}")
    with bench.start(8, SEED=SEED, STALL_PERCENT=40) as simulator:
        found = []
        for _ in range(2):
            simulator.request(EVERY_BYTE)
            run_to_burst(simulator)
            simulator.request_waits()
            found += simulator.run(0)
        before, waits = found
        assert isinstance(before, Waits)
        assert isinstance(waits, Waits)
        assert before.counts == (0, 0, 0, 0)
        assert (before.first, waits.first, waits.cycle) == (before.cycle, before.cycle, simulator.cycle)
        # A stalled host takes 256 beats in some 427 cycles.
        assert waits.counts == waits.counts[:1] * 4
        assert 100 < waits.counts[0] < 250
        simulator.request_waits()
        assert simulator.run(0) == [Waits(waits.cycle, simulator.cycle, (0, 0, 0, 0))]


def test_waits_are_not_counted_after_the_end_of_their_count(bench: PipeBench) -> None:
    """The next request begins a count; neither the cycles before the end nor those after it belong to it."""
    print(f"seed {SEED}")
    with bench.start(8, SEED=SEED, STALL_PERCENT=40) as simulator:
        simulator.request_waits()
        simulator.request(EVERY_BYTE)
        run_to_burst(simulator)
        for is_counted in (False, True):
            simulator.end_waits()
            if not is_counted:
                simulator.request(EVERY_BYTE)
                run_to_burst(simulator)
            begun = simulator.cycle
            simulator.request_waits()
            assert simulator.run(0) == [Waits(begun, begun, (0, 0, 0, 0))]
            simulator.request(EVERY_BYTE)
            run_to_burst(simulator)
            simulator.request_waits()
            (waits,) = simulator.run(0)
            assert isinstance(waits, Waits)
            assert (waits.first, waits.cycle) == (begun, simulator.cycle)
            assert waits.counts == waits.counts[:1] * 4
            assert 100 < waits.counts[0] < 250


def test_all_simulators_count_the_same_waits(tmp_path: Path) -> None:
    found = []
    for tool in TOOLS:
        (tmp_path / tool).mkdir()
        with pipe_bench(tool, tmp_path / tool).start(8, SEED=SEED, STALL_PERCENT=47) as simulator:
            for _ in range(4):
                simulator.request_waits()
                found += simulator.run(0)
                simulator.request(EVERY_BYTE * 2)
                run_to_burst(simulator)
    print(f"seed {SEED}: {found[:4]}")
    assert found == found[:4] * len(TOOLS)
    assert [event.counts[0] > 100 for event in found[:4] if isinstance(event, Waits)] == [False, True, True, True]


def test_a_run_ends_with_the_cycle_in_which_something_happens(bench: PipeBench) -> None:
    with bench.start() as simulator:
        assert (simulator.run(0), simulator.cycle, simulator.quiet) == ([], 0, 0)
        assert (simulator.run(25), simulator.cycle, simulator.quiet) == ([], 25, 25)
        simulator.request(FRAME)
        # It is offered at the end of the first cycle.
        assert simulator.run(9) == []
        assert (simulator.cycle, simulator.quiet) == (34, 0)
        events = simulator.run(1000)
        assert events == [Taken(26, 34), Burst(FRAME, 7, 26, 34)]
        assert simulator.cycle == 35
        assert (simulator.run(10), simulator.quiet) == ([], 10)


def test_an_aborted_frame_is_a_burst_that_aborts(bench: PipeBench) -> None:
    with bench.start(16, STALL_PERCENT=30, SEED=SEED) as simulator:
        simulator.request(FRAME)
        simulator.request(FRAME[:3], is_aborted=True)
        simulator.request(FRAME)
        bursts = [event for event in run_to_rest(simulator) if isinstance(event, Burst)]
    assert [(burst.data, burst.is_aborted) for burst in bursts] == [(FRAME, False), (FRAME[:3], True), (FRAME, False)]


def test_a_frame_with_a_hole_has_a_byte_that_is_not_kept(bench: PipeBench) -> None:
    # The bench returns every beat, and the host refuses it.
    requests = b"H\x03\x00\x00\x00\x06\x00\x00\x00" + FRAME[:6] + b"R\x64\x00\x00\x00"
    status, reports, printed = ended(bench, requests, 16)
    assert status != 0
    assert "cycle 2" in printed and "neither full nor the last" in printed
    assert reports == VERSION


def test_pulses_of_errors(bench: PipeBench) -> None:
    with bench.start(FAULT="id_pulse") as simulator:
        simulator.request(FRAME)
        assert simulator.run(100)[:1] == [ErrorPulse(None, 3)]
    with bench.start(FAULT="frame_pulse") as simulator:
        simulator.request(FRAME)
        assert simulator.run(100)[:1] == [ErrorPulse(0, 3, 7)]
        assert simulator.cycle == 4


@pytest.mark.parametrize(
    ("fault", "message", "needs_x"),
    [
        ("unstable", "the stream from the system changes before s_axis_tready rises", False),
        ("withdrawn", "s_axis_tvalid falls before s_axis_tready rises", False),
        ("sparse", "s_axis_tkeep is undefined or not contiguous from the lowest lane", False),
        ("partial", "a beat that is neither full nor the last", False),
        ("empty", "a beat without a byte", False),
        ("wrong_tid", "s_axis_tid changes within a burst", False),
        ("undefined", "byte 4 of a burst is ", True),
        ("unknown_valid", "s_axis_tvalid is 'X'", True),
        ("unknown_last", "s_axis_tlast is 'X'", True),
        ("unknown_ready", "m_axis_tready is 'X'", True),
        ("unknown_pulse", "id_error is ", True),
    ],
)
def test_a_broken_system_ends_it(bench: PipeBench, fault: str, message: str, needs_x: bool) -> None:
    if needs_x and not bench.is_four_valued:
        pytest.skip("Verilator knows no 'X'")
    print(f"seed {SEED}")
    with bench.start(16, FAULT=fault, STALL_PERCENT=60, SEED=SEED) as simulator:
        simulator.request(FRAME)
        with pytest.raises(TransportError, match=r"the simulator .* it printed:") as caught:
            run_to_rest(simulator)
    assert message in str(caught.value)
    assert "cycle " in str(caught.value)


def test_what_happened_before_a_fault_is_reported(bench: PipeBench) -> None:
    with bench.start(16, FAULT="wrong_tid") as simulator:
        simulator.request(b"\x01\x02")
        simulator.request(FRAME)
        assert simulator.run(100) == [Taken(1, 1), Burst(b"\x01\x02", 1, 1, 1)]
        with pytest.raises(TransportError, match="s_axis_tid changes within a burst"):
            simulator.run(100)


def ended(bench: PipeBench, requests: bytes, width: int = 8, fault: str = "none") -> tuple[int, bytes, str]:
    """Status, reports and output of a simulator that reads just these requests."""
    command = bench.command(width, FAULT=fault)
    requests_file, reports_file = bench.folder / "requests", bench.folder / "reports"
    requests_file.write_bytes(requests)
    done = subprocess.run(
        [
            "/bin/sh",
            "-c",
            'exec 3<"$1" 4>"$2"; shift 2; exec "$@"',
            "sh",
            requests_file,
            reports_file,
            *command,
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, reports_file.read_bytes(), done.stdout


def test_what_happened_in_the_cycle_of_a_fault_is_reported(bench: PipeBench) -> None:
    # The third beat is the frame's last, so it is taken in the cycle in which it comes back with a wrong tid.
    requests = b"F\x06\x00\x00\x00" + FRAME[:6] + b"R\x64\x00\x00\x00"
    status, reports, printed = ended(bench, requests, 16, "wrong_tid")
    assert status != 0
    assert "s_axis_tid changes within a burst" in printed
    assert reports == VERSION + b"T" + (1).to_bytes(8, "little") + (3).to_bytes(8, "little")


@pytest.mark.parametrize(
    ("requests", "message"),
    [
        (b"X", "unknown request 88; legal: F, A, H, R, W, N, Q"),
        (b"\x00", "unknown request 0; legal: F, A, H, R, W, N, Q"),
        (b"R\x01\x00", "the requests end within a request"),
        (b"F\x04\x00\x00\x00abc", "the requests end within a request"),
        (b"F\x00\x00\x00\x00", "the requested frame has no bytes"),
        (b"H\x04\x00\x00\x00\x04\x00\x00\x00abcd", "the requested frame has no byte 4"),
        (b"F\x00\x00\x00\x80", "a number in a request is greater than 2147483647"),
        (b"R\xff\xff\xff\xff", "a number in a request is greater than 2147483647"),
    ],
)
def test_a_broken_request_ends_it(bench: PipeBench, requests: bytes, message: str) -> None:
    status, reports, printed = ended(bench, b"R\x02\x00\x00\x00" + requests)
    assert status != 0
    assert message in printed
    # What was right before is answered.
    assert reports == VERSION + b"S" + (2).to_bytes(8, "little") + (2).to_bytes(4, "little")


def test_the_end_of_the_requests_is_an_end(bench: PipeBench) -> None:
    assert ended(bench, b"")[:2] == (0, VERSION)
    assert ended(bench, b"Q")[:2] == (0, VERSION + b"S" + bytes(12))
    assert ended(bench, b"QR\x05\x00\x00\x00")[:2] == (0, VERSION + b"S" + bytes(12))


def test_without_pipes_it_says_so(bench: PipeBench) -> None:
    done = subprocess.run(
        ["/bin/sh", "-c", 'exec 3<&- 4>&-; exec "$@"', "sh", *bench.command()],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "file descriptor 3 cannot be read; a program that sends frames starts this simulator" in done.stdout


_HOST = """
import sys, time
from fusesoc_firm.node.transport.simulator import Simulator
simulator = Simulator(sys.argv[1:])
print(simulator._process.pid, flush=True)
simulator.run(1)
print("up", flush=True)
{then}
"""


@pytest.mark.parametrize(
    "then",
    [
        "time.sleep(60)",
        "while True: simulator.run(100_000)",
        "simulator._requests.write(b'F\\x00\\x00\\x00\\x01abc'); simulator._requests.flush(); time.sleep(60)",
    ],
    ids=["at rest", "in a run", "in mid-frame"],
)
def test_it_ends_with_its_host(bench: PipeBench, then: str) -> None:
    host = subprocess.Popen(
        [sys.executable, "-c", _HOST.format(then=then), *bench.command()], stdout=subprocess.PIPE, text=True
    )
    assert host.stdout is not None
    simulator = int(host.stdout.readline())
    assert host.stdout.readline() == "up\n"
    time.sleep(0.2)
    host.send_signal(signal.SIGKILL)
    host.wait()
    # A run goes on to its end, which nobody reads.
    assert gone(simulator)


def gone(process: int) -> bool:
    """Wait until a process has ended."""
    while True:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        if "\nState:\tZ" in Path(f"/proc/{process}/status").read_text():
            return True
        time.sleep(0.05)


def test_a_long_frame_takes_bounded_time_and_memory(bench: PipeBench) -> None:
    size = 6_000_000 if bench.tool == "verilator" else 200_000
    frame = random.Random(SEED).randbytes(size)
    with bench.start(64) as simulator:
        simulator.request(frame)
        events = run_to_rest(simulator)
        memory = Path(f"/proc/{simulator.pid}/status").read_text().partition("VmHWM:")[2].split()[0]
    print(f"seed {SEED}, {memory} KiB")
    assert [event.data for event in events if isinstance(event, Burst)] == [frame]
    assert int(memory) < 400_000


def test_illegal_generics_are_named(bench: PipeBench) -> None:
    wrong: list[tuple[Callable[[], Simulator], str]] = [
        (lambda: bench.start(SEED=0), "SEED is 0; legal: 1 to 2147483562"),
        (lambda: bench.start(STALL_PERCENT=100), "STALL_PERCENT is 100; legal: 0 to 99"),
    ]
    for start, message in wrong:
        with start() as simulator, pytest.raises(TransportError, match=message):
            simulator.run(1)
