"""Systems with ids of two bytes: generated and simulated, with publishers in groups that follow from their periods."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.system.derived.model import PublisherTimes
from fusesoc_firm.system.derived.tree import groups_by_period
from fusesoc_firm.system.hardware.status import status_map
from fusesoc_firm.system.status_frames import read_request, status_answer
from tests.hdl.frames import traffic, write_expected, write_stimulus
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

SEED = seeded(20261123)
# Ids that no subscriber has, with a byte of the status id.
UNKNOWN = (0x00FF, 0xFF00, 0x01FF, 0xFFFE)


def generated(
    folder: Path, publishers: int, width: int, *, messages: int, scheduler: str = "auto", status: str = "none"
) -> GeneratedSystem:
    """A subscriber whose messages all publishers send; periods from a seed."""
    source = random.Random(SEED)
    names = ", ".join(f"{{name: pub{number}}}" for number in range(publishers))
    blocks = [f"  - {{name: sub, middleware: ROS1, mode: subscriber, message: std_msgs/UInt16, outgoing: [{names}]}}"]
    for number in range(publishers):
        period = source.randint(1_000, 2_000_000)
        blocks.append(
            f"  - {{name: pub{number}, middleware: ROS1, mode: publisher, message: std_msgs/UInt16, period: {period}}}"
        )
    folder.mkdir(parents=True, exist_ok=True)
    spec, stimuli, model = (folder / name for name in ("spec.yaml", "stimuli.yaml", "model.py"))
    settings = f"{{name: tree, width: {width}, idBytes: 2, scheduler: {scheduler}, status: {status}}}"
    spec.write_text(f"project: {settings}\nblocks:\n" + "\n".join(blocks) + "\n", encoding="utf-8")
    lines = (f"- sub: {{data: {source.randrange(2**16)}}}\n" for _ in range(messages))
    stimuli.write_text("".join(lines), encoding="utf-8")
    model.write_text(
        f"def respond(_, message):\n    return [(f'pub{{number}}', message) for number in range({publishers})]\n",
        encoding="utf-8",
    )
    return build(call(spec, stimuli, model), folder / "system")


@pytest.mark.one_in(3, 3)
@pytest.mark.parametrize("width", [8, 16, 64])
@pytest.mark.parametrize("scheduler", ["auto", "lru", "fixed_priority"])
def test_messages_come_from_the_right_ids(tmp_path: Path, width: int, scheduler: str) -> None:
    system = generated(tmp_path, 11, width, messages=5, scheduler=scheduler)
    for stall in (0, 40):
        assert system.passes(SEED=SEED, STALL_PERCENT=stall)


@pytest.mark.parametrize("width", [8, 16, pytest.param(128, marks=pytest.mark.check)])
def test_requests_of_the_status_are_found_among_other_frames(tmp_path: Path, width: int) -> None:
    """Among frames of ids with one byte of the status id; requests that are aborted, too short or too long."""
    publishers, messages = 5, 6
    system = generated(tmp_path, publishers, width, messages=1, status="frames")
    registers = status_map("tree", 1, publishers).by_name
    print(f"seed {SEED}")
    source = random.Random(SEED)
    good = [(pack_frame(0, source.randbytes(2), 2), "good") for _ in range(messages)]
    unknown = [(pack_frame(id_, source.randbytes(size), 2), "unknown") for id_ in UNKNOWN for size in (0, 3, 8, 9)]
    unknown += [(bytes([byte]), "unknown") for byte in (0xFF, 0xFF, 3)]
    request = read_request(registers["magic"].address, 2)
    wrong = [
        (frame, "wrong") for frame in (request[:-1], request[:6], b"\xff\xff", request + b"\0", request + bytes(90))
    ]
    asked = [(request, "status")] * 5
    frames = [*good, *unknown, *wrong, *asked, (request, "aborted")]
    source.shuffle(frames)
    expected = {
        "subscriber[0].frames": messages,
        **{f"publisher[{number}].frames": messages for number in range(publishers)},
        "id_errors": len(unknown),
        "lost": 0,
        "shape": 0x01000001 | publishers << 12,
    }
    magic = (registers["magic"].address, 0x4D524946)
    # Reserved addresses are those of channel 0 without their highest bits.
    reserved = [(address + word, 0) for address in (0x48000, 0x88000) for word in (0, 4, 0x34)]
    words = [magic] * 60 + [(registers[name].address, word) for name, word in expected.items()] + reserved
    frames += [(read_request(address, 2), "status") for address, _ in words]
    answers = [magic] * len(asked) + words
    found: list[tuple[int, bytes]] = []
    for place, (frame, kind) in enumerate(frames):
        if kind == "good":
            found += [(place, pack_frame(number, frame[6:], 2)) for number in range(publishers)]
        elif kind == "status":
            found.append((place, status_answer(*answers.pop(0), 2)))
    aborted = [place for place, (_, kind) in enumerate(frames) if kind == "aborted"]
    write_stimulus(tmp_path / "system" / "stimulus.txt", [frame for frame, _ in frames], aborted, id_bytes=2)
    write_expected(tmp_path / "system" / "expected.txt", found, len(unknown))
    for stall in (0, 40):
        assert system.passes(SEED=SEED, STALL_PERCENT=stall)


@pytest.mark.check
@pytest.mark.parametrize("status", ["axi_lite", "frames"])
def test_a_status_changes_no_frame(tmp_path: Path, status: str) -> None:
    system = generated(tmp_path, 11, 16, messages=5, status=status)
    assert system.passes(SEED=SEED, STALL_PERCENT=30)
    assert system.work.latches("tree_system") == []


@pytest.mark.check
def test_more_publishers_than_a_byte_has_values(tmp_path: Path) -> None:
    assert generated(tmp_path, 300, 8, messages=2).passes(SEED=SEED, STALL_PERCENT=30)


@pytest.mark.check
def test_1024_publishers_use_the_whole_channel(tmp_path: Path) -> None:
    result = generated(tmp_path, 1024, 8, messages=3).run(SEED=SEED, STALL_PERCENT=0, WATCHDOG=100000)
    assert result.exit_code == 0
    found = traffic(result.output)
    # Latencies of one message's way from the host and back.
    assert found.cycles <= found.beats_out + 40


def test_groups_follow_from_periods() -> None:
    source = random.Random(SEED)
    times = [PublisherTimes(source.randint(50_000, 5_000_000), 10, None) for _ in range(1000)]
    groups = groups_by_period(times)
    assert sorted(number for group in groups for number in group) == list(range(1000))
    for group in groups:
        assert len(group) * len(groups) * 10 <= min(times[number].period or 0 for number in group)
    # The shortest periods are in the smallest group.
    assert len(groups[0]) == min(map(len, groups[:-1]))


@pytest.mark.parametrize("count", [1, 2, 5, 256, 1024, 65536])
def test_without_periods_groups_are_equal(count: int) -> None:
    groups = groups_by_period([PublisherTimes(None, None, None)] * count)
    assert [number for group in groups for number in group] == list(range(count))
    assert len(groups) <= 256
    assert max(map(len, groups)) <= 256
