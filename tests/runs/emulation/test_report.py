"""What an emulated program says, compared with what it should."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from fusesoc_firm.core.request import no_core_folders
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.runs.emulation.emulated_run import Emulation, Report, memory_of
from fusesoc_firm.runs.emulation.messages import emulated_traffic, load_emulated
from fusesoc_firm.runs.emulation.program import PROCESSORS, sizes
from fusesoc_firm.system.message_sources import MessageSources
from tests.hdl.ghdl import REPOSITORY

SPEC = REPOSITORY / "specs" / "multi_type" / "multi_type_link.yaml"


@pytest.fixture(scope="module")
def emulation() -> Emulation:
    loaded = load_emulated(SPEC, MessageSources(), no_core_folders)
    traffic = emulated_traffic(SPEC, loaded, {"stimuli": None, "model": None})

    def start() -> None:
        raise AssertionError("nothing is simulated here")

    return Emulation(Path("player.elf"), PROCESSORS["zynq7000"], start, traffic, loaded.system)  # type: ignore[arg-type]


def right(emulation: Emulation) -> list[bytes]:
    ids = {item.block: item.id for item in emulation.system.publishers}
    return [pack_frame(ids[item.publisher.block], item.payload) for item in emulation.traffic.responses]


def test_frames_and_counts_are_read() -> None:
    report = Report()
    for line in ("frame 0102", "frame ", "counts sent=3 lost=0 good=2", "assertion of FreeRTOS: tasks.c", "frame 0"):
        report.add(line)
    assert report.frames == [b"\1\2", b""]
    assert report.counts == {"sent": 3, "lost": 0, "good": 2}
    assert report.other_lines == ["assertion of FreeRTOS: tasks.c", "frame 0"]


def test_publishers_may_overtake_each_other(emulation: Emulation) -> None:
    frames = right(emulation)
    assert emulation.faults(Report(frames)) == []
    assert emulation.faults(Report(sorted(frames, key=lambda frame: frame[0]))) == []


def test_each_difference_is_a_fault(emulation: Emulation) -> None:
    frames = right(emulation)
    changed = [frames[0][:-1] + bytes([frames[0][-1] ^ 1]), *frames[1:]]
    (fault,) = emulation.faults(Report(changed))
    assert fault.startswith("message 0 of 'twist_out': received {") and ", expected {" in fault
    (fault,) = emulation.faults(Report([frames[0][:-1], *frames[1:]]))
    assert "bytes (" in fault
    (fault,) = emulation.faults(Report([*frames, frames[0]]))
    assert fault == "'twist_out' sent 13 messages, expected 12"
    assert len(emulation.faults(Report([*frames, b"\x09\0\0\0\0", b""]))) == 2
    assert len(emulation.faults(Report())) == 3


def test_the_memory_of_a_program(emulation: Emulation) -> None:
    stimuli = emulation.traffic.stimuli
    data = memory_of(stimuli, emulation.system.subscribers)
    (count,) = struct.unpack_from("<I", data)
    assert count == len(stimuli)
    place = 4
    for stimulus in stimuli:
        subscriber, size = struct.unpack_from("<II", data, place)
        assert emulation.system.subscribers[subscriber].block == stimulus.subscriber.block
        assert data[place + 8 : place + 8 + size] == stimulus.payload
        place += 8 + (size + 3) // 4 * 4
    assert place == len(data)


def test_sizes_of_a_node_in_c(emulation: Emulation) -> None:
    assert sizes(emulation.system) == {"FIRM_SUBSCRIBERS": 3, "FIRM_PUBLISHERS": 3, "FIRM_LONGEST_PAYLOAD": 19400}
