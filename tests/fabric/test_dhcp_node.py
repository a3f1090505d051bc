"""The generated node of a system with DHCP: what becomes of frames when it gets an address and loses it."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from tests.cores.datagrams import ADDRESS
from tests.cores.dhcp import ACK, DISCOVER, NAK, REQUEST, Message, offer
from tests.cores.test_net_link import NODE
from tests.fabric.test_generated_node import HERE, SPECIFICATION, hardware
from tests.fabric.test_network_status import _announced, _publisher, _samples
from tests.hdl.ghdl import Library, core_files

# More than the node's program takes for one.
MS_CYCLES = 64
PREAMBLE_BYTES, FCS_BYTES = 8, 4
REFUSED = "error 7"
MESSAGE, TAKES, WAITS = "2\n", "3 1\n", "3 0\n"
# A reader without acknowledgements.
_QUALITY = ", qos: {profile: sensor_data}, outgoing"
WITH_DHCP = SPECIFICATION.replace("192.0.2.9, phy: mii", "dhcp").replace(", outgoing", _QUALITY)


def _row(frame: list[int]) -> str:
    return " ".join(map(str, (0, len(frame), *frame))) + "\n"


def _line(line: bytes) -> str:
    """A row for what is on the line."""
    return _row([*line[PREAMBLE_BYTES:-FCS_BYTES]])


def _dhcp(message: Message) -> str:
    return _row(message.frame())


def _pause(ms: int) -> str:
    return f"1 {ms}\n"


def _run(folder: Path, specification: str, rows: list[str]) -> list[str]:
    (folder / "events.txt").write_text("".join(rows), encoding="ascii")
    library = Library("firm", folder)
    made = hardware(folder, f"{MS_CYCLES} kHz", specification)
    library.analyse([*core_files("axis/package", "sim/checker", *NODE[1:]), *made, HERE / "dhcp_node.vhd"])
    result = library.run("dhcp_node", {"MS_CYCLES": MS_CYCLES}, directory=folder, options=["--ieee-asserts=disable"])
    assert result.exit_code == 0, result.output
    return (folder / "results.txt").read_text(encoding="ascii").splitlines()


@pytest.mark.check
@pytest.mark.parametrize("has_status", [False, True])
def test_frames_are_whole_when_the_address_is_lost(tmp_path: Path, has_status: bool) -> None:
    """The lease is renewed at once; the server refuses it while the node has three samples for a system that waits.

    The first one has begun, and is taken as a whole. The others are lost with the address.
    """
    # The address of the packets of test_network_status.
    lease = [MESSAGE, _dhcp(offer(address=ADDRESS)), MESSAGE, _dhcp(offer(ACK, address=ADDRESS, times=(1, 50)))]
    known = [MESSAGE, _line(_announced(1)), _line(_publisher(1, 1)), _pause(500)]
    lost = [WAITS, _line(_samples(1, 1, 1, 3)), _pause(50), _dhcp(offer(NAK, address=ADDRESS)), _pause(50), TAKES]
    specification = WITH_DHCP.replace("interconnect", "status: frames\n  interconnect") if has_status else WITH_DHCP
    rows = _run(tmp_path, specification, [*lease, *known, *lost, _pause(200)])
    payload = rtps.XCDR1 + _samples(1, 1, 1, 1)[-FCS_BYTES - 32 : -FCS_BYTES]
    frame = "taken " + " ".join(map(str, (0, len(payload), 0, 0, 0, *payload)))
    assert [row for row in rows if row.startswith(("taken", "part"))] == [frame]
    messages = [f"message {kind}" for kind in (DISCOVER, REQUEST, REQUEST)]
    assert [row for row in rows if row.startswith("message")] == messages
    # Frames of the system are dropped and counted without an address, and only then.
    bound_at = rows.index("announced")
    lost_at = len(rows) - 1 - rows[::-1].index("played")
    # One has begun before.
    assert rows[bound_at:lost_at].count(REFUSED) <= 1
    assert rows[:bound_at].count(REFUSED) > 10
    assert rows[lost_at:].count(REFUSED) > 10
