"""The program of a node: its assembler, and the slots of its history."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fusesoc_firm.fabric import control
from fusesoc_firm.fabric.control import (
    MOST_PEERS,
    MOST_WORDS,
    WORD_BITS,
    ProgramError,
    Sizes,
    rings_of,
    slots_of,
    words_of,
)
from fusesoc_firm.fabric.node import Node
from fusesoc_firm.system.derived.model import Quality
from tests.fabric.test_participant import a_node

SMALL = Sizes(sources=1, sinks=1)


def node(*qualities: Quality) -> Node:
    """A node with a writer of each quality."""
    return a_node(1, {f"t{number}": quality for number, quality in enumerate(qualities)}, {"in": Quality()})


def words(text: str, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The words of a text and of what is constant of a node without topics."""

    class Program:
        name = "program"

        @staticmethod
        def read_text(encoding: str) -> str:
            tables = "table entity 8\ntable number 0\ntable first 4\ntable depth 14\ntable transient 15\n"
            return tables + text

    monkeypatch.setattr(control, "PROGRAM", Program)
    return words_of(replace(node(), endpoints=node().endpoints[:1]), SMALL)


def test_the_program_of_the_largest_node_fits() -> None:
    quality = Quality(depth=15)
    largest = a_node(1, {f"o{n}": quality for n in range(8)}, {f"i{n}": quality for n in range(8)})
    made = words_of(largest, Sizes.of(largest))
    assert len(made) <= MOST_WORDS
    assert all(0 <= word < 1 << WORD_BITS for word in made)


def test_there_is_room_for_each_topic_of_each_peer() -> None:
    """The writer of ros_discovery_info has readers, too."""
    assert Sizes.of(node(Quality())) == Sizes(sources=MOST_PEERS, sinks=2 * MOST_PEERS)
    # The hardware has at least one entry for the writers of peers.
    assert Sizes.of(a_node(1, {}, {})) == Sizes(sources=1, sinks=MOST_PEERS)


@pytest.mark.parametrize(
    ("line", "word"),
    [
        # operation, number, size, destination, source
        ("add.4 a, b", 0b0001_0_010 << 28 | 172 << 14 | 180),
        ("copy P.x, 300", 0b0000_1_000 << 28 | (1 << 12 | 5) << 14 | 300),
        ("sub.28 E.y+2, W.entity", 0b0010_0_111 << 28 | (2 << 12 | 9) << 14 | 3 << 12 | 8),
        ("cmp io.start, field.COUNT", 0b0011_0_000 << 28 | (256 + 0x9C) << 14 | 256 + 36),
        ("load W, a", 0b0111_0_000 << 28 | 2 << 14 | 172),
        ("store a, X", 0b1000_0_000 << 28 | 172 << 14 | 3),
        ("step E, 9", 0b1010_0_000 << 28 | 1 << 14 | 9),
        ("jump here", 0b1011_0_000 << 28),
        ("jump nc, here", 0b1011_0_000 << 28 | 0b0101 << 14),
        ("jump no_frame, here", 0b1011_0_000 << 28 | 0b1101 << 14),
        ("jump work, here", 0b1011_0_000 << 28 | 0b1110 << 14),
        ("call here", 0b1100_0_000 << 28),
        ("return ; a comment", 0b1101_0_000 << 28),
    ],
)
def test_an_instruction_becomes_its_word(line: str, word: int, monkeypatch: pytest.MonkeyPatch) -> None:
    names = "global a 172\nglobal b 180\npeer x 5\nentry y 7\n"
    assert words(f"{names}here:\n{line}", monkeypatch)[0] == word


@pytest.mark.parametrize(
    "line", ["jump nowhere", "copy a, 1", "copy.3 b, 1", "copy b, 16384", "copy b", "load Q, 1", "hop", "jump never, x"]
)
def test_a_wrong_line_is_named(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ProgramError, match=rf"program:7: {line.replace('.', '[.]').replace(',', ',?')}"):
        words(f"global b 180\n{line}", monkeypatch)


def test_the_rings_of_writers_do_not_overlap_and_begin_at_multiples_of_their_sizes() -> None:
    volatile = Quality(is_reliable=False, depth=100)
    many = node(
        Quality(depth=3), volatile, Quality(depth=100), Quality(depth=4), Quality(is_transient_local=True, depth=1)
    )
    rings = rings_of(many)
    # One more than is kept, of a best-effort writer that is not transient local none.
    assert [ring.size for ring in rings] == [4, 2, 128, 8, 2]
    assert all(ring.base % ring.size == 0 for ring in rings)
    used = [slot for ring in rings for slot in range(ring.base, ring.base + ring.size)]
    assert len(used) == len(set(used))
    assert max(used) < slots_of(many) == 256


@pytest.mark.parametrize(
    ("qualities", "message"),
    [
        ((Quality(depth=128),), "rt/t0 keeps 128 samples; at most 127 are kept"),
        ((Quality(depth=100),) * 3, "the writers need 384 slots for their samples; there are at most 256"),
    ],
)
def test_a_history_that_is_too_large_is_refused(qualities: tuple[Quality, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        words_of(node(*qualities), SMALL)
