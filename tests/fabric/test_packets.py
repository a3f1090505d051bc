"""The programs of packets: what they build equals what the reference sends, and tshark finds nothing wrong."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.packets import FRAGMENT_BYTES, programs_of
from tests.cores.ethernet import checksum, fcs, padded, write_capture
from tests.fabric.messages import (
    AckNack,
    Data,
    DataFrag,
    Gap,
    Heartbeat,
    InfoDestination,
    NackFrag,
    Numbers,
    Submessage,
    Writer,
)
from tests.fabric.programs import PEER, PORT, Fields, random_fields, run
from tests.fabric.test_node import node
from tests.hdl.ghdl import REPOSITORY
from tests.seeds import seeded

SEED = seeded(20261127)
NODE = node()
PROGRAMS = programs_of(NODE)


def built(name: str, fields: Fields, payload: bytes = b"") -> bytes:
    return run(PROGRAMS, name, fields, payload)


def expected(name: str, fields: Fields, payload: bytes) -> list[Submessage]:
    """The submessages of a packet to a peer, without that which names it."""
    ends = fields.reader, fields.writer
    heartbeat = Heartbeat(*ends, fields.first, fields.last, fields.count)
    data = Data(*ends, fields.number, payload + bytes(-len(payload) % 4))
    part = DataFrag(*ends, fields.number, fields.fragment, 1, FRAGMENT_BYTES, fields.sample_bytes, data.payload or b"")
    graph = Data(fields.reader, NODE.writers[0].entity, 1, NODE.graph + bytes(-len(NODE.graph) % 4))
    acknowledge = AckNack(*ends, Numbers(fields.number), fields.count)
    missing = Numbers(fields.fragment, 32, fields.fragment_set)
    publications = rtps.PUBLICATIONS_READER, rtps.PUBLICATIONS_WRITER
    subscriptions = rtps.SUBSCRIPTIONS_READER, rtps.SUBSCRIPTIONS_WRITER
    packets: dict[str, list[Submessage]] = {
        "graph": [graph],
        "graph_told": [graph, heartbeat],
        "sample": [data],
        "sample_told": [data, heartbeat],
        "fragment": [part],
        "fragment_told": [part, heartbeat],
        "heartbeat": [heartbeat],
        "acknowledge": [acknowledge],
        "request": [AckNack(*ends, Numbers(fields.number, 32, fields.set), fields.count)],
        "request_fragments": [acknowledge, NackFrag(*ends, fields.number, missing, fields.second_count)],
        "gap": [Gap(*ends, fields.first, Numbers(fields.last))],
        "writers_told": [Heartbeat(*publications, 1, len(NODE.writers), fields.count)],
        "readers_told": [Heartbeat(*subscriptions, 1, len(NODE.readers), fields.count)],
        **{
            f"writer_{number}": [Data(*publications, number, NODE.endpoint_data(item))]
            for number, item in enumerate(NODE.writers, 1)
        },
        **{
            f"reader_{number}": [Data(*subscriptions, number, NODE.endpoint_data(item))]
            for number, item in enumerate(NODE.readers, 1)
        },
    }
    return packets[name]


def in_frame(message: bytes, *, is_for_group: bool = False) -> bytes:
    """A frame around a message, as RFC 768 and RFC 791 have it."""
    target = bytes([239, 255, 0, 1]) if is_for_group else PEER.address
    port = rtps.multicast_port(3) if is_for_group else PORT
    udp = b"".join(number.to_bytes(2, "big") for number in (rtps.metatraffic_port(3), port, 8 + len(message), 0))
    length = (20 + len(udp) + len(message)).to_bytes(2, "big")
    header = b"\x45\0" + length + b"\0\0\x40\0\x40\x11" + bytes(2) + NODE.network.address.packed + target
    header = header[:10] + checksum(header).to_bytes(2, "big") + header[12:]
    mac = bytes.fromhex("01005e7f0001") if is_for_group else PEER.mac
    return mac + NODE.network.mac + b"\x08\0" + header + udp + message


GROUP = ("announce_to_group", "leave_group")
ALL = ("announce", "leave")


@pytest.mark.parametrize("name", [name for name in PROGRAMS.entries if name not in GROUP + ALL])
def test_a_packet_to_a_peer_is_that_of_the_reference(name: str) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    for _ in range(20):
        has_payload = name.startswith(("sample", "fragment"))
        fields, payload = random_fields(chance), chance.randbytes(chance.randrange(1, 60) if has_payload else 0)
        items = expected(name, fields, payload)
        message = Writer().message(NODE.prefix, InfoDestination(fields.prefix), *items)
        assert built(name, fields, payload) == in_frame(message)


@pytest.mark.parametrize("name", GROUP + ALL)
def test_announcements_name_no_receiver(name: str) -> None:
    inline, key = NODE.farewell
    announcement = Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 1, NODE.participant_data)
    farewell = Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 2, key, tuple(inline.items()), is_key=True)
    message = Writer().message(NODE.prefix, farewell if name.startswith("leave") else announcement)
    frame = built(name, random_fields(random.Random(SEED)))
    assert frame == in_frame(message, is_for_group=name in GROUP)


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_finds_right_checksums_and_nothing_malformed(tmp_path: Path) -> None:
    chance = random.Random(SEED)
    sizes = {"sample": 28, "sample_told": 28, "fragment": FRAGMENT_BYTES, "fragment_told": FRAGMENT_BYTES}
    payloads = {name: bytes(sizes.get(name, 0)) for name in PROGRAMS.entries}
    # A fragment has to be within its sample.
    fields = replace(random_fields(chance), fragment=2, sample_bytes=4 * FRAGMENT_BYTES)
    frames = [padded(built(name, fields, payload)) for name, payload in payloads.items()]
    write_capture(tmp_path / "built.pcap", [frame + fcs(frame) for frame in frames])
    command = ["tshark", "-r", "built.pcap", "-o", "ip.check_checksum:TRUE", "-T", "fields"]
    shown = ["-e", "ip.checksum.status", "-e", "_ws.col.Protocol", "-e", "_ws.malformed"]
    done = subprocess.run([*command, *shown], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert [line.split("\t") for line in done.stdout.splitlines()] == [["1", "RTPS", ""]] * len(frames)


def test_programs_fit_into_the_memory_of_their_addresses() -> None:
    assert len(PROGRAMS.words) <= 1 << PROGRAMS.address_bits
    assert all(0 <= word < 1 << 11 for word in PROGRAMS.words)


def test_fragments_have_the_size_of_the_hardware() -> None:
    package = (REPOSITORY / "cores/net/rtl/firm_rtps_pkg.vhd").read_text(encoding="utf-8")
    assert re.findall(r"RTPS_FRAGMENT_BYTES : positive := (\d+);", package) == [str(FRAGMENT_BYTES)]
