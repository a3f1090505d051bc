"""The numbers of RTPS that the packets of a node contain (OMG DDSI-RTPS 2.5, chapter 9; ports: section 9.6.2).

`make constants` writes those that hardware compares into `cores/net/rtl/firm_rtps_pkg.vhd`.
"""

from __future__ import annotations

import struct
from enum import IntEnum

HEADER = b"RTPS\x02\x02"
# The vendor id of implementations without one.
VENDOR = bytes(2)
# The multicast address of all participants, on the multicast port of their domain.
MULTICAST = "239.255.0.1"

PARTICIPANT = bytes.fromhex("000001c1")
NO_ENTITY = bytes(4)
PARTICIPANT_WRITER = bytes.fromhex("000100c2")
PUBLICATIONS_WRITER, PUBLICATIONS_READER = bytes.fromhex("000003c2"), bytes.fromhex("000003c7")
SUBSCRIPTIONS_WRITER, SUBSCRIPTIONS_READER = bytes.fromhex("000004c2"), bytes.fromhex("000004c7")
# Writer and reader of participants, of publications and of subscriptions.
BUILTIN_ENDPOINTS = 0x3F
# The kinds of user endpoints without a key, in the last byte of an entity id.
USER_WRITER, USER_READER = 0x03, 0x04
# The encodings of a payload: a parameter list and XCDR version 1, both little-endian.
PARAMETER_LIST, XCDR1 = b"\x00\x03\x00\x00", b"\x00\x01\x00\x00"
DISPOSED, UNREGISTERED = 1, 2


class Kind(IntEnum):
    """The kinds of submessages."""

    PAD = 0x01
    ACKNACK = 0x06
    HEARTBEAT = 0x07
    GAP = 0x08
    INFO_TIMESTAMP = 0x09
    INFO_DESTINATION = 0x0E
    NACK_FRAG = 0x12
    HEARTBEAT_FRAG = 0x13
    DATA = 0x15
    DATA_FRAG = 0x16


class Parameter(IntEnum):
    """The ids of parameters."""

    PAD = 0x00
    SENTINEL = 0x01
    LEASE_DURATION = 0x02
    TOPIC_NAME = 0x05
    TYPE_NAME = 0x07
    PROTOCOL_VERSION = 0x15
    VENDOR_ID = 0x16
    RELIABILITY = 0x1A
    DURABILITY = 0x1D
    PARTITION = 0x29
    USER_DATA = 0x2C
    UNICAST_LOCATOR = 0x2F
    DEFAULT_UNICAST_LOCATOR = 0x31
    METATRAFFIC_UNICAST_LOCATOR = 0x32
    PARTICIPANT_GUID = 0x50
    BUILTIN_ENDPOINT_SET = 0x58
    ENDPOINT_GUID = 0x5A
    KEY_HASH = 0x70
    STATUS_INFO = 0x71
    DATA_REPRESENTATION = 0x73


class Reliability(IntEnum):
    """The value of a reliability."""

    BEST_EFFORT = 1
    RELIABLE = 2


class Durability(IntEnum):
    """The values of a durability that ROS 2 uses."""

    VOLATILE = 0
    TRANSIENT_LOCAL = 1


def multicast_port(domain: int) -> int:
    """Return the port on which all participants of a domain listen for new ones."""
    return 7400 + 250 * domain


def metatraffic_port(domain: int) -> int:
    """Return the port for discovery of the first participant at an address."""
    return multicast_port(domain) + 10


def user_port(domain: int) -> int:
    """Return the port for user data of the first participant at an address."""
    return multicast_port(domain) + 11


def parameter(number: int, value: bytes) -> bytes:
    """Return a parameter, padded to a multiple of four bytes."""
    padded = value + bytes(-len(value) % 4)
    return struct.pack("<HH", number, len(padded)) + padded


def parameter_list(*parameters: bytes) -> bytes:
    """Return a payload that is a list of parameters."""
    return PARAMETER_LIST + b"".join(parameters) + parameter(Parameter.SENTINEL, b"")


def octets(value: bytes) -> bytes:
    """Return a sequence of octets: its length and its bytes."""
    return struct.pack("<I", len(value)) + value


def string(text: str) -> bytes:
    """Return a string: its length with the terminating NUL, and its bytes."""
    return octets(text.encode() + b"\0")
