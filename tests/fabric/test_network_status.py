"""The status of a node by Ethernet: each fault of its network is provoked at the pins of its PHY, and read by UDP."""

from __future__ import annotations

import shutil
import struct
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Self

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.rtps import Parameter, Reliability, octets, parameter, parameter_list, string
from fusesoc_firm.fabric.simulated_board import SimulatedBoard
from fusesoc_firm.node.status.status import Status, read_status, status_text
from fusesoc_firm.node.transport.built_simulator import build_simulator
from fusesoc_firm.node.transport.transport import Burst
from fusesoc_firm.system.hardware.status import network_words
from fusesoc_firm.system.scaffold.core_file import NETWORK
from fusesoc_firm.system.status_frames import answered, status_answer
from tests.cores.datagrams import ADDRESS, MAC, PEER_ADDRESS, PEER_MAC, Packet
from tests.cores.ethernet import padded
from tests.cores.fragments import HOSTS, fragments
from tests.cores.requests import echo_request
from tests.fabric.messages import Data, DataFrag, Submessage, Writer
from tests.fabric.participant_tables import DISCOVERY

STATUS_PORT = 7399
METATRAFFIC_PORT, USER_PORT = rtps.metatraffic_port(0), rtps.user_port(0)
HEADERS_BYTES, FCS_BYTES = 14 + 20 + 8, 4
PREAMBLE = b"\x55" * 7 + b"\xd5"
# Questions of the simulated PHY without a frame, after which a board that does not reply is given up.
MOST_QUESTIONS = 20_000
# Questions in which the node acts on what came.
QUESTIONS = 400
TYPE = "geometry_msgs::msg::dds_::Quaternion_"
OTHER_TYPE = "std_msgs::msg::dds_::String_"
SPECIFICATION = """\
project:
  name: turtle
  clock: 125 MHz
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:02", address: 192.0.2.2, phy: rgmii}
  status: frames
blocks:
  - {name: turn, middleware: ROS2, mode: subscriber, message: geometry_msgs/Quaternion, qos: {profile: sensor_data},
     outgoing: [{name: turned}]}
  - {name: turned, middleware: ROS2, mode: publisher, message: geometry_msgs/Quaternion, qos: {profile: sensor_data}}
"""
# Messages that need several packets are put together.
LONGEST = 8000
LONG_SPECIFICATION = f"""\
{SPECIFICATION}\
  - {{name: heard, middleware: ROS2, mode: subscriber, message: std_msgs/String, maxLength: {LONGEST},
     qos: {{profile: sensor_data}}, outgoing: [{{name: said}}]}}
  - {{name: said, middleware: ROS2, mode: publisher, message: std_msgs/String, qos: {{profile: sensor_data}}}}
"""

# One process builds and plays the board.
pytestmark = [pytest.mark.check, pytest.mark.xdist_group("network_status")]


class Board(SimulatedBoard):
    """A board whose line this test plays, as fast as it is simulated; also the transport to its status."""

    def __init__(self, command: Sequence[str], folder: Path) -> None:
        super().__init__(command, folder, 1)
        self.frames: list[bytes] = []
        self.cycles = 0  # so far
        self._sent = bytearray()

    def run(self, is_over: Callable[[], bool] = lambda: False) -> None:
        """Let time pass."""
        while not is_over():
            self._answer(b"")

    def play(self, lines: Iterable[bytes], questions: int = QUESTIONS) -> None:
        """Send what is on the line, one after the other, then nothing for some time."""
        for line in (*lines, *[b""] * questions):
            self._answer(line)

    def _answer(self, line: bytes) -> None:
        while (report := self.read(1)) != b"w":
            if report == b"b":
                self._sent += self.read(1)
            else:
                assert report == b"e"
                frame, self._sent = bytes(self._sent[len(PREAMBLE) : -FCS_BYTES]), bytearray()
                self.frames.append(frame)
        self.cycles += int.from_bytes(self.read(4), "little")
        self.write(len(line).to_bytes(2, "little") + line)

    # --- the status, as a transport

    def send(self, frame: bytes) -> None:
        asked = answered(frame)
        assert asked
        self.frames.clear()
        self.play([line(Packet(struct.pack("<2I", *asked), port=STATUS_PORT).frame())], 0)

    def receive(self, timeout: float | None = None) -> Burst | None:
        for _ in range(MOST_QUESTIONS):
            self.play([], 1)
            for frame in self.frames:
                if frame[23] == 17 and frame[34:36] == struct.pack(">H", STATUS_PORT):
                    assert frame[:14] == PEER_MAC + MAC + b"\x08\x00"
                    assert frame[26:34] == ADDRESS + PEER_ADDRESS
                    return Burst(status_answer(*struct.unpack_from("<2I", frame, HEADERS_BYTES)))
        return None

    def is_ready(self) -> bool:
        return True

    def is_at_rest(self) -> bool | None:
        return None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def line(frame: bytes) -> bytes:
    """A frame on the line."""
    return PREAMBLE + frame + zlib.crc32(frame).to_bytes(FCS_BYTES, "little")


def _board(folder: Path, specification: str) -> Board:
    if not shutil.which("verilator"):
        pytest.skip("verilator is not installed")
    spec = folder / "turtle.yaml"
    spec.write_text(specification, encoding="utf-8")
    target = f"{NETWORK}_verilator"
    built = build_simulator(spec, "verilator", build_root=folder / "build", target=target)
    return Board(built.words, built.folder)


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterable[Board]:
    with _board(tmp_path_factory.mktemp("board"), SPECIFICATION) as started:
        yield started


# --- what peers send -------------------------------------------------------------------------------------------------


def _prefix(number: int) -> bytes:
    return b"\1\x0f" + bytes(9) + bytes([number])


def _packet(port: int, number: int, *items: Submessage) -> bytes:
    return line(Packet(Writer().message(_prefix(number), *items), port=port).frame())


def _announced(number: int, payload: bytes | None = None) -> bytes:
    """A participant."""
    place = struct.pack("<II12x4s", 1, 7412, PEER_ADDRESS)
    listed = parameter_list(
        parameter(Parameter.PARTICIPANT_GUID, _prefix(number) + rtps.PARTICIPANT),
        parameter(Parameter.DEFAULT_UNICAST_LOCATOR, place),
        parameter(Parameter.METATRAFFIC_UNICAST_LOCATOR, place),
    )
    item = Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 1, listed if payload is None else payload)
    return _packet(METATRAFFIC_PORT, number, item)


def _publisher(peer: int, number: int, type_: str = TYPE) -> bytes:
    """The publisher with this number, from 1 on, of a participant."""
    writer = rtps.PUBLICATIONS_WRITER
    return _packet(METATRAFFIC_PORT, peer, Data(DISCOVERY[writer], writer, number, _listed(peer, number, type_)))


def _listed(peer: int, number: int, type_: str) -> bytes:
    return parameter_list(
        parameter(Parameter.ENDPOINT_GUID, _prefix(peer) + _entity(number)),
        parameter(Parameter.TOPIC_NAME, string("rt/turn")),
        parameter(Parameter.TYPE_NAME, string(type_)),
        parameter(Parameter.RELIABILITY, struct.pack("<I8x", Reliability.BEST_EFFORT)),
        parameter(Parameter.USER_DATA, octets(b"typehash=;")),
    )


def _entity(number: int) -> bytes:
    return bytes([0, 0, number, rtps.USER_WRITER])


def _samples(peer: int, writer: int, first: int, count: int) -> bytes:
    payload = rtps.XCDR1 + struct.pack("<4d", 1, 2, 3, 4)
    items = [Data(rtps.NO_ENTITY, _entity(writer), first + number, payload) for number in range(count)]
    return _packet(USER_PORT, peer, *items)


def _cut(packet: bytes) -> bytes:
    """A packet of RTPS in whose last submessage bytes are missing."""
    return line(Packet(packet[:-3], port=METATRAFFIC_PORT).frame())


def _arp_reply(mac: bytes, address: bytes) -> bytes:
    head = bytes.fromhex("0806 0001 0800 06 04 0002")
    return line(padded(PEER_MAC + mac + head + mac + address + PEER_MAC + PEER_ADDRESS))


# --- the tests -------------------------------------------------------------------------------------------------------


def _counts(status: Status) -> dict[str, int]:
    return {name.removeprefix("network_"): status.words[name] for name in network_words()}


def _new(board: Board, lines: Iterable[bytes]) -> dict[str, int]:
    """What is counted because of some lines."""
    before = _counts(read_status(board))
    board.play(lines)
    after = _counts(read_status(board))
    return {name: after[name] - before[name] for name in after if after[name] != before[name]}


def test_a_good_network_counts_nothing(board: Board) -> None:
    assert _new(board, [line(echo_request(bytes(40))), _announced(1), _publisher(1, 1)]) == {}
    assert _new(board, [_samples(1, 1, 1, 3)]) == {}
    status = read_status(board)
    assert status.words["subscriber[0].frames"] == status.words["publisher[0].frames"] == 3
    assert "network: no faults" in status_text(status)


def test_a_fragment_of_an_announcement_is_not_read_as_a_list(board: Board) -> None:
    """It has the topic and another type, and no end."""
    writer = rtps.PUBLICATIONS_WRITER
    listed = _listed(1, 2, OTHER_TYPE)
    first = DataFrag(DISCOVERY[writer], writer, 2, 1, 1, len(listed) - 8, len(listed), listed[:-8])
    assert _new(board, [_packet(METATRAFFIC_PORT, 1, first)]) == {}


def test_each_fault_of_the_network_is_counted(board: Board) -> None:
    """The board knows one participant with one publisher, of the test before."""
    good, broken = line(echo_request(bytes(40))), bytearray(line(echo_request(bytes(40))))
    broken[30] ^= 1
    assert _new(board, [bytes(broken), good, bytes(broken)]) == {"broken_frames": 2}
    assert _new(board, [line(Packet(b"abc", udp_checksum=1).frame())]) == {"broken_datagrams": 1}
    assert _new(board, [line(Packet(b"abc", length=500).frame())]) == {"broken_datagrams": 1}
    assert _new(board, [line(Packet(bytes(64), fragment=0x2000).frame())]) == {"dropped_fragments": 1}
    assert _new(board, [_arp_reply(b"\2\0\0\0\0\7", ADDRESS)]) == {"taken_addresses": 1}
    cut = Writer().message(_prefix(1), Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 1, bytes(60)))
    assert _new(board, [_cut(cut)]) == {"broken_packets": 1}
    endless = rtps.PARAMETER_LIST + parameter(Parameter.USER_DATA, bytes(40))
    assert _new(board, [_announced(1, endless), _announced(1, endless[:-8])]) == {"broken_packets": 2}
    assert _new(board, [_publisher(1, 2, OTHER_TYPE)]) == {"other_endpoints": 1}
    # Sixteen of a packet's messages can wait.
    assert _new(board, [_samples(1, 1, 4, 16)]) == {}
    assert _new(board, [_samples(1, 1, 20, 17)]) == {"lost_messages": 1}
    part = DataFrag(rtps.NO_ENTITY, _entity(1), 40, 1, 1, 1000, 3000, bytes(1000))
    assert _new(board, [_packet(USER_PORT, 1, part)]) == {"lost_messages": 1}
    # Eight places for publishers.
    assert _new(board, [_publisher(1, number) for number in range(3, 12)]) == {"refused_endpoints": 2}
    # Eight places for participants.
    assert _new(board, [_announced(number) for number in range(2, 12)]) == {"refused_nodes": 3}
    assert "network: 3 times another node has no room" in status_text(read_status(board))


def test_packets_of_discovery_that_come_too_fast_are_counted(board: Board) -> None:
    counted = _new(board, [_announced(1)] * 200)
    assert set(counted) == {"lost_packets"}
    assert 0 < counted["lost_packets"] < 200


def _in_fragments(number: int) -> list[bytes]:
    """A datagram of several packets, to a port at which nothing listens."""
    udp = struct.pack(">4H", 9, 9, 8 + LONGEST, 0) + bytes(LONGEST)
    return [line(frame) for frame in fragments(HOSTS[0], number, udp)]


def test_faults_of_a_board_that_puts_packets_together_are_counted(tmp_path: Path) -> None:
    with _board(tmp_path, LONG_SPECIFICATION) as board:
        whole = _in_fragments(1)
        assert len(whole) > 3
        assert _new(board, whole) == {}
        # The third fragment ends the packet.
        assert _new(board, [_in_fragments(2)[place] for place in (0, 2)]) == {"dropped_fragments": 1}
        # Frames wait while a packet leaves, up to 4,095 bytes of them.
        waiting = [line(Packet(bytes(1400), port=9).frame())] * 4
        assert _new(board, [*_in_fragments(3), *waiting]) == {"lost_packets": 2}
