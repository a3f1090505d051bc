"""The status of whole systems, read by frames: what it counts is what was sent."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.system.hardware.status import status_map
from fusesoc_firm.system.status_frames import read_request, status_answer
from tests.hdl.frames import write_stimulus
from tests.hdl.ghdl import REPOSITORY, Library
from tests.system.simulated.systems import GeneratedSystem, build, call

SPEC = REPOSITORY / "specs" / "quat2euler"
WIDTHS = [8, pytest.param(64, marks=pytest.mark.check), pytest.param(128, marks=pytest.mark.check), 512]
QUATERNION = bytes(24) + bytes.fromhex("000000000000f03f")
POINT = bytes(24)
MAP = status_map("quat2euler", 1, 1)
# A register that never changes; to read it takes time, in which responses leave.
PAUSE = ["magic"] * 60


def system_with_status(
    folder: Path, width: int, interconnect: str = "axi_stream", status: str = "frames"
) -> GeneratedSystem:
    """The system quat2euler with a status, in a folder of its own."""
    source = folder / "source"
    source.mkdir()
    project = (
        f"name: quat2euler\n  width: {width}\n  status: {status}\n  interconnect: {interconnect}\n  clock: 100 MHz"
    )
    text = (SPEC / "quat2euler.yaml").read_text().replace("name: quat2euler\n", f"{project}\n", 1)
    (source / "quat2euler.yaml").write_text(text)
    (source / "rtl").symlink_to(SPEC / "rtl")
    for name in ("stimuli.yaml", "model.py"):
        (source / name).symlink_to(SPEC / name)
    request = call(source / "quat2euler.yaml", source / "stimuli.yaml", source / "model.py")
    return build(request, folder, "acc/float64/float64", "acc/cordic/cordic")


def exchange(system: GeneratedSystem, sent: list[tuple[bytes, bytes | None]], id_errors: int, faults: int) -> None:
    """Send frames, each with the response that it causes, in a simulation with stalls."""
    write_stimulus(system.folder / "stimulus.txt", (frame for frame, _ in sent))
    lines = [f"! id_error {id_errors}\n! frame_error {faults}\n"]
    lines += [f"< @{number} frame\n  {answer.hex()}\n" for number, (_, answer) in enumerate(sent) if answer]
    (system.folder / "expected.txt").write_text("".join(lines))
    result = system.run(SEED=7, STALL_PERCENT=25)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("width", WIDTHS)
def test_frames_and_faults_are_counted(tmp_path: Path, width: int) -> None:
    system = system_with_status(tmp_path, width)
    good = (pack_frame(0, QUATERNION), pack_frame(0, POINT))
    wrong_length = (b"\x00" + (31).to_bytes(4, "little") + QUATERNION, None)
    cut = (pack_frame(0, QUATERNION)[:-1], None)
    unknown = (pack_frame(3, b"abc"), None)
    traffic = [good] * 6 + [wrong_length] * 3 + [cut] * 2 + [unknown] * 4
    random.Random(width).shuffle(traffic)
    expected = {
        "subscriber[0].frames": 11,
        "subscriber[0].faults[0]": 3,
        "subscriber[0].faults[1]": 2,
        "publisher[0].frames": 6,
        "id_errors": 4,
        "lost": 0,
        "shape": 0x01001001,
        "interrupt": 0b0011,
    }
    reads = [(name, 0x4D524946) for name in PAUSE] + [*expected.items()]
    requests = [
        (read_request(MAP.by_name[name].address), status_answer(MAP.by_name[name].address, word))
        for name, word in reads
    ]
    # A request between other frames, and three that are none.
    wrong = [(b"\xff", None), (b"\xff" + bytes(40), None), (read_request(0)[:-1], None)]
    exchange(system, [*traffic[:5], requests[0], *wrong, *traffic[5:], *requests], 4, 5)


@pytest.mark.parametrize(
    ("interconnect", "status"),
    [
        ("axi_stream", "axi_lite"),
        # A byte takes a hundred cycles.
        pytest.param("uart", "frames", marks=pytest.mark.thorough),
        pytest.param("spi", "frames", marks=pytest.mark.thorough),
    ],
)
def test_a_status_changes_no_frame(tmp_path: Path, interconnect: str, status: str) -> None:
    system = system_with_status(tmp_path, 8, interconnect, status)
    assert system.passes(STALL_PERCENT=25)
    if interconnect == "axi_stream":  # the simulated synchronisers of a link cannot be synthesised
        assert Library("work", tmp_path).latches("quat2euler_system") == []
