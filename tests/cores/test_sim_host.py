"""The simulation host in VHDL and in Verilog: accepted files, detected faults, printed reports, and its end."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hdl.benches import SIMULATORS, Bench, bench
from tests.hdl.frames import random_frames, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Generic
from tests.recall import RunResult
from tests.seeds import seeded

SEED = seeded(20240504)

STIMULUS = """\
# A comment, and a label without text.
> first x=1
  00 02000000 aabb

>
  01 0300
  0000\t0a0B0c
"""
EXPECTED = """\
< @0 answer to first
  00 02000000 aabb
< @1
  01 03000000 ..0b..
"""


ANNOUNCEMENTS = "expected '! id_error <pulses>', '! frame_error <pulses>' or '! aborted <id> <code>'"
ABORTED = "expected '! aborted 7 10', the frame's id and the code of aborted frames"


@pytest.fixture(scope="module", params=SIMULATORS)
def host(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return bench(
        request.param,
        "firm_sim_host_tb",
        ("axis/package", "axis/axis", "sim/checker", "sim/host"),
        tmp_path_factory.mktemp("host"),
    )


def _run(
    host: Bench, directory: Path, stimulus: str = STIMULUS, expected: str = EXPECTED, **generics: Generic
) -> RunResult:
    (directory / "stimulus.txt").write_text(stimulus, encoding="latin-1", newline="")
    (directory / "expected.txt").write_text(expected, encoding="latin-1", newline="")
    return host.run(directory, **generics)


def test_the_report_of_a_good_run(host: Bench, tmp_path: Path) -> None:
    result = _run(host, tmp_path)
    assert result.exit_code == 0
    assert result.output.splitlines() == [
        f"seed 1, stalls 0 %, 8 bits; to repeat: {host.repeat(1, 0)}",
        "  0 > first x=1",
        "    < answer to first",
        "    6 cycles first beat in to last beat out, -6 last beat in to first beat out",
        "  1 > ",
        "    < ",
        "    7 cycles first beat in to last beat out, -7 last beat in to first beat out",
        "2 frames in, 2 frames out, 15 cycles from the first beat in to the last beat out",
        "in: 15 beats, 100 % of these cycles; out: 15 beats, 100 %",
        "PASS 2/2",
    ]


def test_what_came_is_written_and_can_be_expected(host: Bench, tmp_path: Path) -> None:
    long = "> long\n  02 50000000" + "5a" * 80
    assert _run(host, tmp_path, f"{STIMULUS}{long}", f"{EXPECTED}{long.replace('>', '<')}").exit_code == 0
    received = (tmp_path / "received.txt").read_text()
    assert received.splitlines() == [
        "< id 00",
        "  0002000000aabb",
        "< id 01",
        "  01030000000a0b0c",
        "< id 02",
        "  0250000000" + "5a" * 59,
        "  " + "5a" * 21,
    ]
    result = _run(host, tmp_path, f"{STIMULUS}{long}", received, RECEIVED_FILE="again.txt", STALL_PERCENT=40)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "again.txt").read_text() == received


def test_only_so_many_frames_are_shown(host: Bench, tmp_path: Path) -> None:
    assert "first" in _run(host, tmp_path, SHOWN=1).output
    assert "  1 >" not in _run(host, tmp_path, SHOWN=1).output
    assert "first x" not in _run(host, tmp_path, SHOWN=0).output


def test_a_run_repeats_with_its_seed(host: Bench, tmp_path: Path) -> None:
    runs = [_run(host, tmp_path, SEED=seed, STALL_PERCENT=50).output for seed in (SEED, SEED, SEED + 1)]
    assert runs[0] == runs[1]
    assert runs[0].splitlines()[1:] != runs[2].splitlines()[1:]


def test_both_hosts_do_the_same_in_every_cycle(tmp_path: Path) -> None:
    frames = random_frames(range(4), 40, 60, SEED)
    write_stimulus(tmp_path / "stimulus.txt", (frame.to_bytes() for frame in frames))
    write_expected(tmp_path / "expected.txt", ((n, frame.to_bytes()) for n, frame in enumerate(frames)))
    reports = []
    for simulator in SIMULATORS:
        (tmp_path / simulator).mkdir()
        host = bench(
            simulator,
            "firm_sim_host_tb",
            ("axis/package", "axis/axis", "sim/checker", "sim/host"),
            tmp_path / simulator,
        )
        seeds = (1, SEED, 2147483562)
        outputs = [host.run(tmp_path, SEED=seed, STALL_PERCENT=47, WIDTH=16, SHOWN=40).output for seed in seeds]
        reports.append([output.splitlines()[1:] for output in outputs])
    assert reports[0] == reports[1]
    assert len({tuple(report) for report in reports[0]}) == len(seeds)


def test_files_of_dos_and_empty_expectations(host: Bench, tmp_path: Path) -> None:
    result = _run(host, tmp_path, STIMULUS.replace("\n", "\r\n"), EXPECTED.replace("\n", "\r\n"))
    assert result.exit_code == 0, result.output
    result = _run(host, tmp_path, expected="", FAULT="mute")
    assert result.output.splitlines()[-1] == "PASS 0/0"


@pytest.mark.one_in(5)
@pytest.mark.parametrize("width", [8, 16, 64, 512])
@pytest.mark.parametrize("stall", [0, 30, 90])
def test_all_lengths_and_widths(host: Bench, tmp_path: Path, width: int, stall: int) -> None:
    frames = random_frames(range(4), 60, 100, SEED)
    write_stimulus(tmp_path / "stimulus.txt", (frame.to_bytes() for frame in frames))
    # In another order than they come, as long as that of each id stays.
    by_id = sorted(enumerate(frames), key=lambda item: item[1].id)
    write_expected(tmp_path / "expected.txt", ((n, frame.to_bytes()) for n, frame in by_id))
    generics: dict[str, Generic] = {
        "WIDTH": width,
        "STALL_PERCENT": stall,
        "SEED": SEED,
        "SHOWN": 0,
        "QUIET": 500,
        "WATCHDOG": 500,
    }
    result = host.run(tmp_path, **generics)
    assert result.exit_code == 0, result.output
    found = traffic(result.output)
    beats = sum(frame.beats(width) for frame in frames)
    assert (found.beats_in, found.beats_out) == (beats, beats)
    if stall == 0:
        assert found.cycles == beats


def test_a_long_frame(host: Bench, tmp_path: Path) -> None:
    image = b"\x00" + (75_000).to_bytes(4, "little") + bytes(range(250)) * 300
    write_stimulus(tmp_path / "stimulus.txt", [image])
    write_expected(tmp_path / "expected.txt", [(0, image)])
    result = host.run(tmp_path, WIDTH=512)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("unstable", "the stream from the system changes before s_axis_tready rises"),
        ("withdrawn", "s_axis_tvalid falls before s_axis_tready rises"),
        ("undefined", "'answer to first': byte 4: expected 00, got 0X"),
        ("unknown_valid", "s_axis_tvalid is 'X'"),
        ("sparse", "'answer to first': tkeep is undefined or not contiguous from the lowest lane"),
        ("partial", "'answer to first': a beat that is neither full nor the last"),
        ("empty", "'answer to first': a beat without a byte"),
        ("wrong_tid", "'answer to first': tid is a5"),
        ("unknown_last", "'answer to first': tlast is 'X'"),
        ("early_last", "'answer to first': ends after 6 bytes, expected 7"),
        ("late_last", "'answer to first': continues after its 7 bytes"),
        ("unknown_ready", "m_axis_tready is 'X'"),
        ("stuck", "'answer to first': stops after 4 bytes without tlast"),
        ("endless", "'answer to first': continues after its 7 bytes"),
        ("stuck", "'first x=1': only 4 bytes taken"),
        ("mute", "missing: 'answer to first'"),
        ("id_pulse", "id_error pulses, announced: 0"),
        ("frame_pulse", "frame_error(0) pulses, announced: 0"),
        ("unknown_pulse", "id_error is '{unknown}'"),
    ],
)
def test_a_broken_system_fails(host: Bench, tmp_path: Path, fault: str, message: str) -> None:
    result = _run(host, tmp_path, WIDTH=16, FAULT=fault, STALL_PERCENT=60, SEED=3)
    assert result.exit_code != 0
    assert message.format(unknown=host.unknown) in result.output
    assert any(line.startswith("FAIL ") for line in result.output.splitlines())


@pytest.mark.parametrize(
    ("expected", "message"),
    [
        (EXPECTED.replace("aabb", "aabc"), "'answer to first': byte 6: expected bc, got bb"),
        (EXPECTED.replace("02000000 aabb", "03000000 aabbcc"), "'answer to first': ends after 7 bytes, expected 8"),
        (EXPECTED.replace("02000000 aabb", "01000000 aa"), "'answer to first': continues after its 6 bytes"),
        (EXPECTED[: EXPECTED.index("< @1")], "frame with id 1: no such frame is expected"),
        (EXPECTED + "< more\n  01 00000000", "missing: 'more'"),
        (EXPECTED.replace("@1", "@2"), "caused by stimulus 2, which does not exist"),
        (EXPECTED + "! id_error 1\n", "id_error pulsed 0 times, announced: 1"),
        (EXPECTED + "! frame_error 2\n", "frame_error pulsed 0 times, announced: 2"),
    ],
)
def test_another_answer_than_expected_fails(host: Bench, tmp_path: Path, expected: str, message: str) -> None:
    result = _run(host, tmp_path, expected=expected, STALL_PERCENT=20, SEED=SEED)
    assert result.exit_code != 0
    assert message in result.output


def test_a_surplus_frame_that_comes_late_fails(host: Bench, tmp_path: Path) -> None:
    result = _run(host, tmp_path, FAULT="late_surplus")
    assert result.exit_code != 0
    assert "frame with id 0: no such frame is expected" in result.output
    assert "FAIL 2/2" in result.output.splitlines()


def test_announced_errors_are_no_faults(host: Bench, tmp_path: Path) -> None:
    for fault, name in (("id_pulse", "id_error"), ("frame_pulse", "frame_error")):
        assert _run(host, tmp_path, expected=f"{EXPECTED}! {name} 1\n", FAULT=fault).exit_code == 0
        assert _run(host, tmp_path, expected=f"{EXPECTED}! {name} 2\n", FAULT=fault).exit_code != 0


def test_aborted_frames_pass_in_both_directions(host: Bench, tmp_path: Path) -> None:
    """Those received are written as they can be expected; their bytes and length may be any."""
    stimulus = STIMULUS + "> broken\n  01 ff000000 aa bb\n! aborted 1 10\n> next\n  01 01000000 cc\n"
    expected = EXPECTED + "< broken\n  01\n! aborted 1 10\n< next\n  01 01000000 cc\n"
    for stall in (0, 40):
        result = _run(host, tmp_path, stimulus, expected, STALL_PERCENT=stall, WIDTH=16)
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[-1] == "PASS 4/4"
        assert "< id 01\n  01ff000000aabb\n! aborted 1 10\n< id 01\n" in (tmp_path / "received.txt").read_text()


def test_a_frame_that_is_aborted_or_not_is_told_apart(host: Bench, tmp_path: Path) -> None:
    result = _run(host, tmp_path, f"{STIMULUS}! aborted 1 10\n", SEED=SEED)
    assert result.exit_code != 0
    assert "is aborted after 8 bytes" in result.output
    result = _run(host, tmp_path, expected=f"{EXPECTED}! aborted 1 10\n", SEED=SEED)
    assert result.exit_code != 0
    assert "is not aborted" in result.output


def test_ten_faults_are_printed_and_the_rest_counted(host: Bench, tmp_path: Path) -> None:
    stimulus = "> a\n  00 14000000" + "00" * 20
    expected = "< @0 a\n  00 14000000" + "01" * 20
    output = _run(host, tmp_path, stimulus, expected).output
    assert output.count("expected 01, got 00") == 10
    assert "and 10 more faults" in output
    assert "FAIL 0/1" in output.splitlines()


@pytest.mark.parametrize(
    ("stimulus", "message"),
    [
        ("", "stimulus.txt:1: the file contains no frames"),
        ("> a\n", "stimulus.txt:2: the frame before this line has no bytes"),
        ("  00\n", "stimulus.txt:1: expected a label line, which starts with '>'"),
        ("> a\n  00\n< b\n  00\n", "stimulus.txt:3: '< ' is not a byte of two hexadecimal digits"),
        ("> a\n  0g\n", "stimulus.txt:2: '0g' is not a byte of two hexadecimal digits"),
        ("> a\n  000\n", "stimulus.txt:2: the line ends with half a byte"),
        ("> a\n  00 ..\n", "stimulus.txt:2: '..' is legal only in an expected frame, after the id"),
        (">a\n  00\n", "stimulus.txt:1: a blank is missing after the first character"),
        ("> a\n  00\n! id_error 1\n", "stimulus.txt:3: expected '! aborted <id> <code>'"),
    ],
)
def test_an_ill_formed_stimulus_file_is_refused(host: Bench, tmp_path: Path, stimulus: str, message: str) -> None:
    result = _run(host, tmp_path, stimulus=stimulus)
    assert result.exit_code != 0
    assert result.output.splitlines()[0] == message


@pytest.mark.parametrize(
    ("expected", "message"),
    [
        ("< a\n  00 0000", "expected.txt:3: the frame before this line is shorter than id and length"),
        (
            "< a\n  00 01000000\n< b\n",
            "expected.txt:3: the frame before this line announces 1 bytes of payload but has 0",
        ),
        ("< a\n  00 000000ff\n", "expected.txt:3: the frame before this line announces more than 2 GiB"),
        ("< @x a\n  00 00000000\n", "expected.txt:1: '@' must be followed by the number of a stimulus frame"),
        ("< a\n  .. 00000000\n", "expected.txt:2: '..' is legal only in an expected frame, after the id"),
        *((line, f"expected.txt:1: {ANNOUNCEMENTS}") for line in ("! id_errors 1\n", "! id_error -1\n")),
        ("! way 1\n", "expected.txt:1: '! way' must follow a frame"),
        *(
            (f"< a\n  00 00000000\n! way {way}\n", "expected.txt:3: '! way' must be followed by a number from 1 to 63")
            for way in ("0", "64", "x")
        ),
        ("! aborted 1 10\n", "expected.txt:1: '! aborted' must follow a frame"),
        ("< a\n! aborted 1 10\n", "expected.txt:2: the frame before this line has no bytes"),
        *((f"< a\n  07\n! aborted {line}\n", f"expected.txt:3: {ABORTED}") for line in ("6 10", "7 9", "7", "7 x")),
    ],
)
def test_an_ill_formed_expected_file_is_refused(host: Bench, tmp_path: Path, expected: str, message: str) -> None:
    result = _run(host, tmp_path, expected=expected)
    assert result.exit_code != 0
    assert result.output.splitlines()[0] == message


def test_a_missing_file_is_named(host: Bench, tmp_path: Path) -> None:
    result = _run(host, tmp_path, EXPECTED_FILE="absent.txt")
    assert result.exit_code != 0
    assert result.output.splitlines()[0] == "absent.txt:1: the file cannot be opened"


@pytest.mark.parametrize(
    ("generic", "value"),
    [
        ("SEED", 0),
        ("SEED", -5),
        ("STALL_PERCENT", 100),
        ("STALL_PERCENT", -1),
        ("WIDTH", 12),
        ("WATCHDOG", 0),
        ("QUIET", 0),
    ],
)
def test_illegal_generics_are_named(host: Bench, tmp_path: Path, generic: str, value: int) -> None:
    result = host.run(tmp_path, **{generic: value})
    assert result.exit_code != 0
    assert f"firm_sim_host: {generic} is {value}; legal: " in result.output


# Two ways to the publisher 3, in turn.
WAYS = "".join(
    f"< @{number} {number}\n  03 02000000 {way}{number:02x}\n! way {way}\n"
    for number, way in ((0, 17), (1, 34), (2, 17), (3, 34), (4, 17))
)


@pytest.mark.parametrize(
    ("order", "fault"),
    [
        ((0, 1, 2, 3, 4), ""),
        ((1, 0, 3, 2, 4), ""),
        ((0, 2, 4, 1, 3), ""),
        ((1, 3, 0, 2, 4), ""),
        ((2, 0, 1, 3, 4), "byte 6: expected 00, got 02"),
        ((0, 3, 1, 2, 4), "byte 6: expected 01, got 03"),
        ((0, 1, 2, 3, 3), "byte 5: expected "),
    ],
)
def test_frames_of_several_ways_come_in_any_order(
    host: Bench, tmp_path: Path, order: tuple[int, ...], fault: str
) -> None:
    """But in order on each way; the bench returns what it is sent."""
    frames = {number: f"03 02000000 {34 if number % 2 else 17}{number:02x}" for number in range(5)}
    stimulus = "".join(f"> {number}\n  {frames[number]}\n" for number in order)
    result = _run(host, tmp_path, stimulus, WAYS, STALL_PERCENT=20)
    assert (result.exit_code == 0) is not bool(fault), result.output
    assert fault in result.output
