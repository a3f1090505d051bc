"""The status of a system: its registers, and their connection to the top level."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Flag

from fusesoc_firm.converter.vhdl import index_bits
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, StatusAccess
from fusesoc_firm.system.derived.status import TREE_CHANNELS
from fusesoc_firm.system.hardware.instances import ERROR_CODE_BITS, INNER, error_of
from fusesoc_firm.system.hardware.interconnect import NETWORK_FAULTS
from fusesoc_firm.system.hardware.registers import RegisterMap, register_map
from fusesoc_firm.text.render import Context, render

DESCRIPTION_TEMPLATE = "rdl/status.rdl"
REGISTERS_TEMPLATE = "vhdl/registers.vhd"

DIGEST_ADDRESS, DIGEST_WORDS = 0x30, 4
_NETWORK_ADDRESS = 0x40
_CHANNELS_ADDRESS, _CHANNEL_BYTES = 0x8000, 0x40
_WORD_DIGITS = 8

# The bits of a register's address beside a Manager, and the channels that they reach.
ADDRESS_BITS, MOST_CHANNELS = 16, 512
# Beside a Manager of Managers, which has at most TREE_CHANNELS.
_TREE_ADDRESS_BITS = 20
# Of the address of a word within a channel.
_WORD_BITS = 4


class Part(Flag):
    """The parts that not every status has; the values are the bits of the register `features`."""

    TIME_STAMPS = 1
    NETWORK = 2


NO_PART = Part(0)


@dataclass(frozen=True)
class Identity:
    """What distinguishes the hardware of a system: `digest`, and the signatures of the channels' messages.

    All are hexadecimal digits. A host that expects another digest would misread the frames of the system.
    """

    digest: str
    signatures: tuple[str, ...]


def identity_of(system: DerivedSystem, signatures: Sequence[str]) -> Identity:
    """Return the identity of a system with the signatures of its messages: the subscribers' by id, then publishers'.

    The digest covers what a host must know: the converters with their ids, topics and messages, and bursts. It does not
    cover clocks, boards and accelerators, since frames are the same for them all.
    """
    described = [
        system.name,
        system.scheduling.is_preemptive,
        [_described(item) for item in system.subscribers],
        [_described(item) for item in system.publishers],
        [*signatures],
    ]
    digest = hashlib.sha256(json.dumps(described).encode()).hexdigest()[: DIGEST_WORDS * _WORD_DIGITS]
    return Identity(digest, tuple(text.removeprefix("RIHS01_")[:_WORD_DIGITS] for text in signatures))


def _described(item: Converter) -> list[object]:
    return [item.id, item.block, item.name, item.frame.ros.title, str(item.frame.message)]


def status_description(name: str, subscribers: int, publishers: int, digest: str = "", parts: Part = NO_PART) -> str:
    """Return the description of a status in SystemRDL; without a `digest`, its registers have the value 0."""
    digits = digest or "0" * (DIGEST_WORDS * _WORD_DIGITS)
    return render(
        DESCRIPTION_TEMPLATE,
        {
            "name": name,
            "subscribers": subscribers,
            "publishers": publishers,
            "time_stamps": Part.TIME_STAMPS in parts,
            "network": [
                {
                    "register": _network_register(name),
                    "title": f"Times that {meaning}",
                    "address": f"{_NETWORK_ADDRESS + 4 * number:03x}",
                }
                for number, (name, meaning) in enumerate(NETWORK_FAULTS.items())
            ]
            if Part.NETWORK in parts
            else [],
            "publisher_address": f"{_CHANNELS_ADDRESS + subscribers * _CHANNEL_BYTES:x}",
            "digest": [
                {
                    "number": number,
                    "low": 32 * number,
                    "word": digits[len(digits) - (number + 1) * _WORD_DIGITS : len(digits) - number * _WORD_DIGITS],
                    "address": f"{DIGEST_ADDRESS + 4 * number:03x}",
                }
                for number in range(DIGEST_WORDS)
            ],
        },
    )


def status_map(name: str, subscribers: int, publishers: int, digest: str = "", parts: Part = NO_PART) -> RegisterMap:
    """Return the registers of a status."""
    return register_map(status_description(name, subscribers, publishers, digest, parts))


def parts_of(system: DerivedSystem) -> Part:
    """Return the parts of the status of a system."""
    wanted = {Part.TIME_STAMPS: system.has_time_stamps, Part.NETWORK: bool(system.network)}
    return Part(sum(part.value for part, is_wanted in wanted.items() if is_wanted))


def network_words() -> dict[str, str]:
    """Return the meanings of the counters of a network, by their registers' names."""
    return {_network_register(name): meaning for name, meaning in NETWORK_FAULTS.items()}


def _network_register(name: str) -> str:
    return f"network_{name}"


def status_entity(system: DerivedSystem) -> str:
    """Return the name of the registers' entity, and of their description."""
    return f"{system.name}_status"


def status_configuration(system: DerivedSystem) -> Context:
    """Return the connection of the status to the top level, and what it changes there."""
    is_frames = system.status is StatusAccess.FRAMES
    return {
        "scope": INNER if system.status else "",
        "inner": INNER if _has_inner_streams(system) else "",
        "address_bits": address_bits(system),
        "link_tid": f"{INNER}m_axis_tid" if is_frames else "open",
        "has_status": bool(system.status),
        "status_bus": system.status is StatusAccess.AXI_LITE,
        "status": _instances(system) if system.status else None,
    }


def address_bits(system: DerivedSystem) -> int:
    """Return the bits of a register's address."""
    return _TREE_ADDRESS_BITS if system.tree else ADDRESS_BITS


def _has_inner_streams(system: DerivedSystem) -> bool:
    """Return whether the Manager's streams are signals: the status is in between, or listens."""
    return system.status is StatusAccess.FRAMES or bool(system.status and system.tree)


def _instances(system: DerivedSystem) -> Context:
    channels = (*system.subscribers, *system.publishers)
    return {
        "tree": bool(system.tree),
        "waits": [{"id": number, "place": place} for number, place in sorted(system.places.items())],
        "has_inner_streams": _has_inner_streams(system),
        "address_bits": address_bits(system),
        "word_bits": _WORD_BITS + index_bits(TREE_CHANNELS if system.tree else MOST_CHANNELS),
        "id_bits": 8 * system.id_bytes,
        "select_bits": index_bits(len(system.subscribers)),
        "entity": status_entity(system),
        "is_frames": system.status is StatusAccess.FRAMES,
        "has_link": bool(system.link),
        "has_network": bool(system.network),
        "fault_count": len(NETWORK_FAULTS),
        "network_faults": [{"register": name, "bit": bit} for bit, name in enumerate(network_words())]
        if system.network
        else [],
        "time_stamps": system.has_time_stamps,
        "host_tid": "open" if system.link or system.network else "m_axis_tid",
        "width": system.width,
        "lanes": system.width // 8,
        "subscriber_count": len(system.subscribers),
        "publisher_count": len(system.publishers),
        "channel_count": len(channels),
        "channel_code_bits": ERROR_CODE_BITS * len(channels),
        "error_count": len(system.error_blocks),
        "error_code_bits": ERROR_CODE_BITS * len(system.error_blocks),
        "channels": [
            {
                "number": number,
                "high": ERROR_CODE_BITS * (number + 1) - 1,
                "low": ERROR_CODE_BITS * number,
                "error": error_of(item, system) if item.block in system.error_blocks else None,
            }
            for number, item in enumerate(channels)
        ],
    }
