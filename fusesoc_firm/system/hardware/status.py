"""The status of a system: its registers, and their connection to the top level."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Flag
from typing import NamedTuple

from fusesoc_firm.converter.vhdl import index_bits
from fusesoc_firm.system.derived.model import BlockParameter, Converter, DerivedSystem, StatusAccess
from fusesoc_firm.system.derived.status import TREE_CHANNELS
from fusesoc_firm.system.hardware.instances import ERROR_CODE_BITS, INNER, error_of
from fusesoc_firm.system.hardware.interconnect import NETWORK_FAULTS
from fusesoc_firm.system.hardware.names import Names
from fusesoc_firm.system.hardware.parameters import parameter_registers
from fusesoc_firm.system.hardware.registers import RegisterMap, register_map
from fusesoc_firm.text.render import Context, render

DESCRIPTION_TEMPLATE = "rdl/status.rdl"
REGISTERS_TEMPLATE = "vhdl/registers.vhd"

DIGEST_ADDRESS, DIGEST_WORDS = 0x30, 4
_NETWORK_ADDRESS = 0x40
# The number of endpoints of an exchange, and their counters.
ENDPOINTS_ADDRESS = 0x2C
_EXCHANGE_ADDRESS, _ENDPOINT_BYTES = 0x4000, 0x20
_CHANNELS_ADDRESS, _CHANNEL_BYTES = 0x8000, 0x40
_WORD_DIGITS = 8

# The address width of the registers with a Manager, and the number of channels that it covers.
ADDRESS_BITS, MOST_CHANNELS = 16, 512
# The address width with a Manager of Managers, which has at most TREE_CHANNELS.
_TREE_ADDRESS_BITS = 20
# The address bits of a word within a channel.
_WORD_BITS = 4


class Part(Flag):
    """The optional parts of a status; the values are the bits of the register `features`."""

    TIME_STAMPS = 1
    NETWORK = 2
    EXCHANGE = 4


class Features(NamedTuple):
    """The optional parts of a status, with the number of endpoints of an exchange."""

    parts: Part = Part(0)
    endpoints: int = 0


NO_FEATURES = Features()

# What is counted at each endpoint of an exchange, by the signal with a bit for each endpoint.
ENDPOINT_WORDS = {
    "sent": "Frames of the publisher that have entered",
    "stalled": "Cycles that a beat of the publisher waited",
    "received": "Frames that the reader has taken",
    "waited": "Cycles that a beat waited for the reader",
    "dropped": "Messages that the reader's queue has dropped",
}


@dataclass(frozen=True)
class Identity:
    """The identity of a system's hardware: `digest`, and the signatures of the channels' messages.

    All are in hexadecimal digits. A host that expects a different digest would misread the system's frames.
    """

    digest: str
    signatures: tuple[str, ...]


def identity_of(system: DerivedSystem, signatures: Sequence[str]) -> Identity:
    """Return the identity of a system; `signatures` are those of the subscribers by id, then of the publishers.

    The digest covers the facts that a host needs: the converters' ids, topics and messages, and preemption. It excludes
    clocks, boards and accelerators, which do not affect frames.
    """
    described = [
        system.name,
        system.scheduling.is_preemptive,
        [_described(item) for item in system.subscribers],
        [_described(item) for item in system.publishers],
        [*signatures],
        *([[[item.name, *map(str, _facts(item))] for item in system.parameters]] if system.parameters else []),
    ]
    digest = hashlib.sha256(json.dumps(described).encode()).hexdigest()[: DIGEST_WORDS * _WORD_DIGITS]
    return Identity(digest, tuple(text.removeprefix("RIHS01_")[:_WORD_DIGITS] for text in signatures))


def _facts(item: BlockParameter) -> tuple[object, ...]:
    return item.parameter.type.name, item.parameter.default, item.parameter.least, item.parameter.most


def _described(item: Converter) -> list[object]:
    return [item.id, item.block, item.name, item.frame.ros.title, str(item.frame.message)]


def status_description(
    name: str,
    shape: tuple[int, int],
    digest: str = "",
    features: Features = NO_FEATURES,
    parameters: tuple[BlockParameter, ...] = (),
) -> str:
    """Return the description of a status in SystemRDL; without a `digest`, its registers have the value 0.

    The `shape` is the number of subscribers and that of publishers.
    """
    subscribers, publishers = shape
    digits = digest or "0" * (DIGEST_WORDS * _WORD_DIGITS)
    return render(
        DESCRIPTION_TEMPLATE,
        {
            "name": name,
            "subscribers": subscribers,
            "publishers": publishers,
            "time_stamps": Part.TIME_STAMPS in features.parts,
            "network": [
                {
                    "register": _network_register(name),
                    "title": f"Times that {meaning}",
                    "address": f"{_NETWORK_ADDRESS + 4 * number:03x}",
                }
                for number, (name, meaning) in enumerate(NETWORK_FAULTS.items())
            ]
            if Part.NETWORK in features.parts
            else [],
            "exchange": {"endpoints": features.endpoints} if features.endpoints else None,
            "endpoints": [
                {
                    "register": endpoint_register(number, word),
                    "title": f"{meaning}, endpoint {number}",
                    "address": f"{_EXCHANGE_ADDRESS + number * _ENDPOINT_BYTES + 4 * place:03x}",
                }
                for number in range(features.endpoints)
                for place, (word, meaning) in enumerate(ENDPOINT_WORDS.items())
            ],
            "parameters": parameter_registers(parameters),
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


def status_map(
    name: str, subscribers: int, publishers: int, digest: str = "", features: Features = NO_FEATURES
) -> RegisterMap:
    """Return the registers of a status."""
    return register_map(status_description(name, (subscribers, publishers), digest, features))


def endpoint_register(number: int, word: str) -> str:
    """Return the name of a counter of an endpoint of the exchange."""
    return f"endpoint{number}_{word}"


def features_of(system: DerivedSystem) -> Features:
    """Return the features of the status of a system."""
    wanted = {
        Part.TIME_STAMPS: system.has_time_stamps,
        Part.NETWORK: bool(system.network),
        Part.EXCHANGE: bool(system.exchange),
    }
    parts = Part(sum(part.value for part, is_wanted in wanted.items() if is_wanted))
    return Features(parts, len(system.exchange.ends) if system.exchange else 0)


def network_words() -> dict[str, str]:
    """Return the meaning of each network counter by register name."""
    return {_network_register(name): meaning for name, meaning in NETWORK_FAULTS.items()}


def _network_register(name: str) -> str:
    return f"network_{name}"


def status_entity(system: DerivedSystem) -> str:
    """Return the name of the registers' entity, and of their description."""
    return f"{system.name}_status"


def status_configuration(names: Names, system: DerivedSystem) -> Context:
    """Return the connection of the status to the top level, and the resulting changes there."""
    return {
        "scope": INNER if system.status else "",
        "inner": INNER if _has_inner_streams(system) else "",
        "address_bits": address_bits(system),
        "manager_tid": _manager_tid(system),
        "has_status": bool(system.status),
        "status_bus": system.status is StatusAccess.AXI_LITE,
        "status": _instances(names, system) if system.status else None,
    }


def _manager_tid(system: DerivedSystem) -> str:
    """Return the signal that receives the ids of the Manager's frames, of which links and nodes use the first byte."""
    if system.link or system.network:
        return f"{INNER}m_axis_tid" if system.status is StatusAccess.FRAMES else "open"
    return f"{INNER if _has_inner_streams(system) else ''}m_axis_tid"


def address_bits(system: DerivedSystem) -> int:
    """Return the width of a register's address."""
    return _TREE_ADDRESS_BITS if system.tree else ADDRESS_BITS


def _has_inner_streams(system: DerivedSystem) -> bool:
    """Return whether the Manager's streams are internal signals, since the status intercepts or monitors them."""
    return system.status is StatusAccess.FRAMES or bool(system.status and system.tree)


def _instances(names: Names, system: DerivedSystem) -> Context:
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
        "events": [
            {"register": endpoint_register(number, word), "signal": names.exchange(word), "bit": number}
            for number in range(len(system.exchange.ends) if system.exchange else 0)
            for word in ENDPOINT_WORDS
        ],
        "parameters": [
            {"number": item.number, **{word: names.parameter(item, word) for word in ("wanted", "value")}}
            for item in system.parameters
        ],
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
