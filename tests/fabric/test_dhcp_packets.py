"""The packets of a node with DHCP: those of a constant address, and messages as tshark reads them."""

from __future__ import annotations

import random
import shutil
import subprocess
from dataclasses import replace
from ipaddress import IPv4Address
from pathlib import Path

import pytest

from fusesoc_firm.fabric import dhcp
from fusesoc_firm.fabric.packets import Programs, plain_program, programs_of
from fusesoc_firm.fabric.presence import PROBE, REPORT, frames_of
from tests.cores.dhcp import DECLINE, DISCOVER, REQUEST
from tests.cores.ethernet import fcs, is_set, padded, write_capture
from tests.cores.requests import MAC
from tests.fabric.programs import random_fields, run
from tests.fabric.test_node import node
from tests.seeds import seeded

SEED = seeded(20261127)
ADDRESS, SERVER = (bytes([192, 0, 2, last]) for last in (57, 1))
SERVER_MAC, NUMBER = bytes.fromhex("020000000001"), bytes.fromhex("12345678")
FIXED = replace(node(), network=replace(node().network, address=IPv4Address(ADDRESS), mac=MAC))
NODE = replace(FIXED, network=replace(FIXED.network, address=IPv4Address(0)))
PROGRAMS = programs_of(NODE, dhcp.programs_of(NODE.network))
FIELDS = random_fields(random.Random(SEED))


def own(kind: int = REQUEST, *, is_bound: bool = True, chooses: bool = False) -> bytes:
    """The bytes of `own_select`, as the bench of the client finds them."""
    slots = bytearray(32)
    for place, value in ((0, ADDRESS), (4, SERVER), (8, NUMBER), (12, SERVER_MAC), (31, bytes([kind]))):
        slots[place : place + len(value)] = value
    slots[30] = 255 if kind == DECLINE else 0
    constants = bytes(number | number << 1 & 32 for number in range(32))
    nothing = bytes(32)
    chosen = (bytes(slots), constants) if chooses else (nothing, nothing)
    return bytes(slots) + (bytes(slots) if is_bound else nothing) + b"".join(chosen)


def built(name: str, bytes_: bytes, programs: Programs = PROGRAMS) -> bytes:
    has_payload = name.startswith(("sample", "fragment"))
    return run(programs, name, FIELDS, b"payload" if has_payload else b"", bytes_)


def test_packets_of_rtps_are_those_of_a_constant_address() -> None:
    fixed = programs_of(FIXED)
    for name in fixed.entries:
        assert built(name, own()) == built(name, b"", fixed), name


def test_report_and_probe_are_those_of_a_constant_address() -> None:
    frames = frames_of(FIXED.network)
    fixed = programs_of(FIXED, {name: plain_program(FIXED.network, frame) for name, frame in frames.items()})
    for name in (REPORT, PROBE):
        assert built(name, own()) == frames[name] == built(name, b"", fixed)


def _fields(folder: Path, frames: list[bytes], *names: str) -> list[dict[str, str]]:
    """What tshark finds in frames."""
    write_capture(folder / "sent.pcap", [padded(frame) + fcs(padded(frame)) for frame in frames])
    shown = [word for name in names for word in ("-e", name)]
    command = ["tshark", "-r", "sent.pcap", "-o", "ip.check_checksum:TRUE", "-T", "fields", *shown]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return [dict(zip(names, line.split("\t"), strict=True)) for line in done.stdout.splitlines()]


NAMES = (
    *("eth.dst", "eth.src", "ip.src", "ip.dst", "ip.len", "ip.checksum.status", "udp.srcport", "udp.dstport"),
    *("udp.length", "dhcp.type", "dhcp.hw.type", "dhcp.hw.len", "dhcp.hops", "dhcp.id", "dhcp.secs", "dhcp.flags"),
    *("dhcp.ip.client", "dhcp.ip.your", "dhcp.ip.relay", "dhcp.hw.mac_addr", "dhcp.cookie", "dhcp.option.type"),
    *("dhcp.option.dhcp", "dhcp.option.hostname", "dhcp.option.request_list_item"),
    *("dhcp.option.requested_ip_address", "dhcp.option.dhcp_server_id", "dhcp.option.end", "_ws.malformed"),
)
MAC_TEXT = MAC.hex(":")
COMMON = {
    "eth.src": MAC_TEXT,
    "ip.checksum.status": "1",
    "udp.srcport": "68",
    "udp.dstport": "67",
    "dhcp.type": "1",
    "dhcp.hw.type": "0x01,0x01",
    "dhcp.hw.len": "6",
    "dhcp.hops": "0",
    "dhcp.id": "0x12345678",
    "dhcp.secs": "0",
    "dhcp.flags": "0x0000",
    "dhcp.ip.your": "0.0.0.0",
    "dhcp.ip.relay": "0.0.0.0",
    "dhcp.cookie": "99.130.83.99",
    "dhcp.option.hostname": "turtle",
    "_ws.malformed": "",
    "dhcp.option.request_list_item": "51,54,58,59",
    "ip.len": "328",
    "udp.length": "308",
    # The second ones are in option 61.
    "dhcp.hw.mac_addr": f"{MAC_TEXT},{MAC_TEXT}",
}
TO_ALL = {"eth.dst": "ff:ff:ff:ff:ff:ff", "ip.dst": "255.255.255.255"}
TO_SERVER = {"eth.dst": SERVER_MAC.hex(":"), "ip.dst": "192.0.2.1"}
UNBOUND = {"ip.src": "0.0.0.0", "dhcp.ip.client": "0.0.0.0"}
BOUND = {"ip.src": "192.0.2.57", "dhcp.ip.client": "192.0.2.57"}
CHOICE = {"dhcp.option.requested_ip_address": "192.0.2.57", "dhcp.option.dhcp_server_id": "192.0.2.1"}
NO_CHOICE = dict.fromkeys(CHOICE, "")


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_each_message(tmp_path: Path) -> None:
    messages = [
        ("dhcp", own(DISCOVER, is_bound=False), TO_ALL | UNBOUND | NO_CHOICE),
        ("dhcp", own(REQUEST, is_bound=False, chooses=True), TO_ALL | UNBOUND | CHOICE),
        ("dhcp", own(DECLINE, is_bound=False, chooses=True), TO_ALL | UNBOUND | CHOICE),
        ("dhcp", own(REQUEST), TO_ALL | BOUND | NO_CHOICE),
        ("renewal", own(REQUEST), TO_SERVER | BOUND | NO_CHOICE),
    ]
    found = _fields(tmp_path, [built(name, bytes_) for name, bytes_, _ in messages], *NAMES)
    for fields, (_, bytes_, special) in zip(found, messages, strict=True):
        tags = [int(tag) for tag in fields.pop("dhcp.option.type").split(",")]
        chosen = [50, 54] if special["dhcp.option.dhcp_server_id"] else []
        told = [] if bytes_[31] == DECLINE else [12, 55]
        assert [tag for tag in tags if tag] == [53, 61, *chosen, *told]
        assert fields.pop("dhcp.option.end") == "255"
        assert fields.pop("dhcp.option.dhcp") == str(bytes_[31])
        # RFC 2131, table 5.
        untold = {} if told else dict.fromkeys(("dhcp.option.hostname", "dhcp.option.request_list_item"), "")
        assert fields == COMMON | special | untold


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_an_announcement(tmp_path: Path) -> None:
    names = (
        "eth.dst",
        "arp.opcode",
        "arp.isannouncement",
        "arp.isgratuitous",
        "arp.src.proto_ipv4",
        "arp.dst.proto_ipv4",
    )
    (fields,) = _fields(tmp_path, [built("announcement", own())], *names)
    assert fields["eth.dst"] == "ff:ff:ff:ff:ff:ff"
    assert fields["arp.opcode"] == "1"
    assert any(fields[name] and is_set(fields[name]) for name in ("arp.isannouncement", "arp.isgratuitous"))
    assert fields["arp.src.proto_ipv4"] == fields["arp.dst.proto_ipv4"] == "192.0.2.57"


@pytest.mark.parametrize(
    ("name", "host"), [("turtle", "turtle"), ("joint_driver_", "joint-driver"), ("a" * 62 + "_b" * 50, "a" * 62)]
)
def test_the_node_s_name_is_that_of_a_host(name: str, host: str) -> None:
    assert dhcp.host_name(replace(NODE.network, name=name)) == host
