"""What differs between the frameworks: the words with which a module names its clocks, streams and buses."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

_CHANNEL = re.compile("(aw|ar|w|b|r)(.+)")


@dataclass(frozen=True)
class Domain:
    """A clock domain: the port of its clock, its usual name, and the argument with another name."""

    port: str
    name: str
    argument: str


@dataclass(frozen=True)
class Framework:
    """A framework: the usual domain of the first clock, names that a port cannot have, and its expressions.

    `domain` refers to a clock domain, `beat` to a field of a stream, `channel` to a field of a bus with its width, and
    `keep` to the bytes of a beat whose source may not drive them.
    """

    first_domain: str
    reserved: frozenset[str]
    domain: Callable[[Domain], str]
    beat: Callable[[str, str], str]
    channel: Callable[[str, str, int], str]
    keep: Callable[[str, int], str]


def _litex_channel(attribute: str, word: str, width: int) -> str:
    match = _CHANNEL.fullmatch(word)
    assert match
    # An address on the bus of a SoC has as many bits as the bus.
    part = f"[:{width}]" if match[2] == "addr" else ""
    return f"self.{attribute}.{match[1]}.{match[2]}{part}"


def _amaranth_beat(attribute: str, word: str) -> str:
    return f"self.{attribute}.{word}" if word in ("valid", "ready") else f"self.{attribute}.payload.{word}"


FRAMEWORKS = {
    "litex": Framework(
        "sys",
        frozenset(
            "add_module add_sources autocsr_exclude clock_domains comb do_exit do_finalize finalize finalized "
            "get_constants get_csrs get_fragment get_fragment_called get_memories get_module get_module_documentation "
            "specials submodules sync".split()
        ),
        lambda domain: domain.argument,
        lambda attribute, word: f"self.{attribute}.{word}",
        _litex_channel,
        # An endpoint's `keep` is 0 where no statement drives it.
        lambda keep, width: f"Mux({keep} == 0, 0x{2**width - 1:X}, {keep})",
    ),
    "amaranth": Framework(
        "sync",
        frozenset("elaborate files metadata signature".split()),
        lambda domain: f'"{domain.name}"',
        _amaranth_beat,
        lambda attribute, word, _: f"self.{attribute}.{word}",
        # The type of the beat has a default for its field.
        lambda keep, width: keep,
    ),
}
