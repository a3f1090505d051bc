"""Messages in several packets of IPv4, at the line of a generated node: Fast DDS sends those longer than a frame so."""

from __future__ import annotations

import random
import re
import struct
import zlib
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path

import pytest

from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import Request
from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.rtps import Parameter, Reliability, octets, parameter, parameter_list, string
from tests.cores.fragments import HOSTS, Host, fragments
from tests.cores.test_net_link import NODE
from tests.fabric.messages import Data, InfoDestination, Submessage, Writer
from tests.fabric.participant_tables import DISCOVERY
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded
from tools.bench.network import LONGEST as LONGEST_GENERICS

SEED = seeded(20261127)
HERE = Path(__file__).parent
PARTS = ("control", "packets", "names", "node")
PREAMBLE, FCS_BYTES = b"\x55" * 7 + b"\xd5", 4
METATRAFFIC_PORT, USER_PORT = rtps.metatraffic_port(0), rtps.user_port(0)
GAP_CYCLES = 12
# Cycles in which the node acts on an announcement.
SLOW_CYCLES = 8000
LONGEST = 8000
LAST_CYCLES = 20000
NODE_PREFIX = rtps.VENDOR + bytes.fromhex("020000000002") + bytes(4)
SPECIFICATION = """\
project:
  name: turtle
  clock: 25 MHz
  interconnect: ethernet
  network: {{mac: "02:00:00:00:00:02", address: 192.0.2.2, phy: mii, reassemblies: {reassemblies}}}
blocks:
  - {{name: heard, middleware: ROS2, mode: subscriber, message: std_msgs/String, maxLength: {longest},
     qos: {{profile: sensor_data}}, outgoing: [{{name: said}}]}}
  - {{name: said, middleware: ROS2, mode: publisher, message: std_msgs/String, qos: {{profile: sensor_data}}}}
"""


def _library(folder: Path, reassemblies: int, longest: int = LONGEST) -> Library:
    """The node with the clock of a simulated board."""
    library = Library("firm", folder)
    paths = _generated(folder, SPECIFICATION.format(reassemblies=reassemblies, longest=longest))
    library.analyse([*core_files(*NODE), *paths, HERE / "playing_node.vhd"])
    return library


def _generated(folder: Path, text: str) -> list[Path]:
    """The files of the node of a specification."""
    (folder / "turtle.yaml").write_text(text, encoding="utf-8")
    others = dict.fromkeys(("board", "paths", "distro"))
    parameters = {"spec": "turtle.yaml", "product": "system", "clock": "250 kHz", **others}
    files = GENERATORS["far"].load(Request("far", "test:sys:turtle-system:0", folder, parameters)).generate().files
    paths = [folder / f"turtle_system_{part}.vhd" for part in PARTS]
    for path in paths:
        path.write_text(str(files[path.name].content), encoding="utf-8")
    return paths


def _generics(folder: Path) -> dict[str, str]:
    """The numbers that the node in a folder gives to firm_net_link."""
    node = (folder / "turtle_system_node.vhd").read_text(encoding="utf-8")
    own = dict(re.findall(r"^  constant ([A-Z]+) +: integer := (\d+);", node, re.MULTILINE))
    return own | dict(re.findall(r"^ +([A-Z]+) +=> (\d+),$", node, re.MULTILINE))


def _taken(
    library: Library, folder: Path, bursts: Iterable[tuple[int, bytes]], last_cycles: int = LAST_CYCLES
) -> list[bytes]:
    """The frames to the system, until some cycles after the last burst."""
    rows = []
    for before, frame in bursts:
        sent = PREAMBLE + frame + zlib.crc32(frame).to_bytes(FCS_BYTES, "little")
        rows.append(" ".join(map(str, (before, len(sent), *sent))))
    (folder / "line.txt").write_text("\n".join(rows) + "\n", encoding="ascii")
    result = library.run("playing_node", {"LAST_CYCLES": last_cycles}, directory=folder)
    assert result.exit_code == 0, result.output
    lines = (folder / "taken.txt").read_text(encoding="ascii").splitlines()
    return [bytes(map(int, line.split()[1:])) for line in lines]


def _prefix(host: Host) -> bytes:
    return b"\1\x0f" + bytes(4) + host.mac


def _frames(host: Host, number: int, port: int, *items: Submessage, size: int = 1480) -> list[bytes]:
    """A packet of RTPS in as many frames as it needs."""
    data = Writer().message(_prefix(host), *items)
    udp = struct.pack(">4H", port, port, 8 + len(data), 0) + data
    return fragments(host, number, udp, size)


def _published(host: Host) -> bytes:
    """The announcement of a publisher."""
    return parameter_list(
        parameter(Parameter.ENDPOINT_GUID, _prefix(host) + bytes([0, 0, 1, rtps.USER_WRITER])),
        parameter(Parameter.TOPIC_NAME, string("rt/heard")),
        parameter(Parameter.TYPE_NAME, string("std_msgs::msg::dds_::String_")),
        parameter(Parameter.RELIABILITY, struct.pack("<I8x", Reliability.BEST_EFFORT)),
    )


def _announced(host: Host) -> list[bytes]:
    """A participant, and its publisher."""
    place = struct.pack("<II12x4s", 1, 7412, host.address)
    listed = parameter_list(
        parameter(Parameter.PARTICIPANT_GUID, _prefix(host) + rtps.PARTICIPANT),
        parameter(Parameter.DEFAULT_UNICAST_LOCATOR, place),
        parameter(Parameter.METATRAFFIC_UNICAST_LOCATOR, place),
    )
    writer = rtps.PUBLICATIONS_WRITER
    participant = Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 1, listed)
    publisher = Data(DISCOVERY[writer], writer, 1, _published(host))
    return [frame for item in (participant, publisher) for frame in _frames(host, 0, METATRAFFIC_PORT, item)]


def _sample(host: Host, number: int, payload: bytes, size: int = 1480) -> list[bytes]:
    item = Data(rtps.NO_ENTITY, bytes([0, 0, 1, rtps.USER_WRITER]), number, payload)
    return _frames(host, number, USER_PORT, InfoDestination(NODE_PREFIX), item, size=size)


def _payload(chance: random.Random, size: int) -> bytes:
    return rtps.XCDR1 + chance.randbytes(size - len(rtps.XCDR1))


def _as_frame(payload: bytes) -> bytes:
    return struct.pack("<BI", 0, len(payload)) + payload


def _interleaved(chance: random.Random, *queues: Sequence[bytes]) -> list[bytes]:
    """Frames of several hosts, those of each in order."""
    left = [list(queue) for queue in queues]
    return [chance.choice([queue for queue in left if queue]).pop(0) for _ in range(sum(map(len, left)))]


def _bursts(hosts: Sequence[Host], frames: Iterable[bytes]) -> list[tuple[int, bytes]]:
    """All hosts announce themselves, then the frames come as fast as the line is."""
    known = [(SLOW_CYCLES, frame) for host in hosts for frame in _announced(host)]
    sent = [(GAP_CYCLES, frame) for frame in frames]
    return [*known, (SLOW_CYCLES, sent[0][1]), *sent[1:]]


@pytest.mark.check
def test_messages_of_all_sizes_arrive_whole(tmp_path: Path) -> None:
    """Of the last three, each waits until the one before is out, in twice the time in which it comes."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    payloads = [_payload(chance, size) for size in (8, 1344, 1400, 1480, 2900, 5001, LONGEST - 1, LONGEST)]
    frames = [frame for number, item in enumerate(payloads, 1) for frame in _sample(HOSTS[0], number, item)]
    taken = _taken(_library(tmp_path, 1), tmp_path, _bursts(HOSTS[:1], frames), 3 * LAST_CYCLES)
    assert taken == [_as_frame(payload) for payload in payloads]


def _exchange(folder: Path, reassemblies: int, hosts: Sequence[Host]) -> tuple[list[bytes], list[bytes]]:
    """The frames that arrive and those that are sent, three messages of each host, whose fragments are interleaved."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    payloads = [[_payload(chance, chance.randrange(3000, 4000)) for _ in hosts] for _ in range(3)]
    frames: list[bytes] = []
    for number, row in enumerate(payloads, 1):
        frames += _interleaved(chance, *(_sample(*item) for item in zip(hosts, [number] * len(row), row, strict=True)))
    taken = _taken(_library(folder, reassemblies), folder, _bursts(hosts, frames))
    return taken, [_as_frame(payload) for row in payloads for payload in row]


@pytest.mark.check
def test_fragments_of_two_hosts_may_be_interleaved(tmp_path: Path) -> None:
    taken, sent = _exchange(tmp_path, 2, HOSTS[:2])
    assert sorted(taken) == sorted(sent)


@pytest.mark.check
def test_messages_of_more_hosts_are_dropped_whole(tmp_path: Path) -> None:
    taken, sent = _exchange(tmp_path, 1, HOSTS[:4])
    assert 3 <= len(taken) < len(sent)
    assert {*taken} < {*sent}


def test_a_message_that_lacks_a_fragment_is_dropped(tmp_path: Path) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    payloads = [_payload(chance, 4000) for _ in range(3)]
    queues = [_sample(HOSTS[0], number, payload) for number, payload in enumerate(payloads, 1)]
    del queues[1][1]
    taken = _taken(_library(tmp_path, 1), tmp_path, _bursts(HOSTS[:1], chain.from_iterable(queues)))
    assert taken == [_as_frame(payloads[0]), _as_frame(payloads[2])]


@pytest.mark.check
def test_announcements_may_come_in_fragments(tmp_path: Path) -> None:
    """Fast DDS announces all endpoints of a participant in one packet to those who ask."""
    host, chance = HOSTS[0], random.Random(SEED)
    (participant, _), writer = _announced(host), rtps.PUBLICATIONS_WRITER
    filler = parameter(Parameter.USER_DATA, octets(chance.randbytes(500)))
    others = [Data(DISCOVERY[writer], writer, number, parameter_list(filler)) for number in range(1, 11)]
    packet = _frames(host, 0, METATRAFFIC_PORT, *others, Data(DISCOVERY[writer], writer, 11, _published(host)))
    assert len(packet) == 4
    payload = _payload(chance, 100)
    bursts = [(SLOW_CYCLES, participant), (SLOW_CYCLES, packet[0]), *((GAP_CYCLES, frame) for frame in packet[1:])]
    bursts += [(4 * SLOW_CYCLES, frame) for frame in _sample(host, 1, payload)]
    assert _taken(_library(tmp_path, 1), tmp_path, bursts) == [_as_frame(payload)]


def test_its_memory_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Four packets and a message of 8,192 bytes, payloads of 4,096, and words of discovery for one packet."""
    path = tmp_path / "turtle.yaml"
    path.write_text(SPECIFICATION.format(reassemblies=2, longest=7936), encoding="utf-8")
    assert main(["system", "check", str(path)]) == 0
    assert "the node needs 62464 bytes of memory for messages in several packets\n" in capsys.readouterr().out


def test_the_memories_for_the_longest_messages_fit_an_ecp5_85(tmp_path: Path) -> None:
    """tools/bench/network.py places them."""
    text = SPECIFICATION.replace("qos: {{profile: sensor_data}}}}", "maxLength: {longest}, qos: {{depth: 1}}}}")
    _generated(tmp_path, text.format(reassemblies=1, longest=65280))
    generics, wanted = _generics(tmp_path), {name: str(value) for name, value in LONGEST_GENERICS.items()}
    assert {name: generics[name] for name in wanted} == wanted
    assert generics["PAYLOADS"] == "4096"


def test_a_node_for_short_messages_has_no_reassembly(tmp_path: Path) -> None:
    _library(tmp_path, 4, 1344)
    generics = _generics(tmp_path)
    assert (generics["REASSEMBLIES"], generics["PAYLOADS"]) == ("0", "4096")
