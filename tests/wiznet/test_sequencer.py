"""The assembler and the tries of the sequencer."""

from __future__ import annotations

import random

import pytest

from fusesoc_firm.fabric.sequencer import MEMORY_BYTES, Assembler, AssemblyError, Operation, Rom
from tests.seeds import seeded
from tests.wiznet.sequencer import Sequencer

SEED = seeded(20261126)


class _NoChip:
    def read(self, space: int, socket: int, address: int, length: int) -> bytes:
        raise AssertionError

    def write(self, space: int, socket: int, address: int, data: bytes) -> None:
        raise AssertionError


def _assembled(program: str) -> Rom:
    rom = Rom()
    Assembler(rom, {}).read(program)
    return rom


def _run(rom: Rom, instructions: int) -> Sequencer:
    sequencer = Sequencer(rom.image(), _NoChip(), lambda: 0)
    for _ in range(instructions):
        sequencer.step()
    return sequencer


def _number_of(strings: dict[bytes, int], text: bytes) -> int:
    """What MATCH and MATCHED find in a trie."""
    rom = Rom()
    steps = "".join(f"set {byte}\nmatch state\n" for byte in text)
    Assembler(rom, {}).read(
        f"local next 2\nlocal state 2\nat strings\ntexted state\n{steps}matched state\ngive\nhere:\njump here"
    )
    rom.add_trie("strings", strings)
    return _run(rom, 4 + 2 * len(text)).given[0][0]


def test_a_trie_knows_its_strings_and_no_others() -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    for _ in range(50):
        words = {bytes(rng.choices(b"ab/c", k=rng.randrange(1, 6))) for _ in range(rng.randrange(1, 12))}
        strings = {word: number for number, word in enumerate(sorted(words), 1)}
        for text in [*words, *(bytes(rng.choices(b"ab/c", k=rng.randrange(7))) for _ in range(10)), b"\xe1", b"\0"]:
            assert _number_of(strings, text) == strings.get(text, 0), (strings, text)


def test_operands_are_numbers_characters_fields_and_addresses() -> None:
    rom = _assembled(
        "global field 4\nalias part field+2\nload part+1 ; a comment\nset 'A'\nset 0x1F\nset >end\nend:\nown"
    )
    set_a = Operation.SET
    expected = [Operation.LOAD, 0x20 + 3, set_a, ord("A"), set_a, 0x1F, set_a, 0, Operation.OWN]
    assert rom.image() == bytes(expected)


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("fly", "line 1: 'fly' is not possible: 'FLY'"),
        ("set", "line 1: 'set' is not possible: it has 1 operands"),
        ("own\nset 5 6", "line 2: 'set 5 6' is not possible: it has 1 operands"),
        ("load nobody", "line 1: 'load nobody' is not possible"),
        ("local a 33", "there is no room"),
        ("global a 1\nglobal a 1", "line 2: 'global a 1' is not possible: the name is there twice"),
        ("here:\nhere:", "label 'here' is there twice"),
        ("jump nowhere", "label 'nowhere' is missing"),
        ("read socket memory 17 0 0", "a transfer has another form"),
    ],
)
def test_a_wrong_program_is_reported(program: str, message: str) -> None:
    with pytest.raises(AssemblyError, match=message.replace("(", r"\(")):
        _assembled(program).image()


def test_arithmetic_carries_through_sixteen_bits() -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    for _ in range(100):
        left, right = rng.randrange(0x10000), rng.randrange(0x10000)
        lines = ["local next 2", "local x 2", "local y 2"]
        for name, value in (("x", left), ("y", right)):
            lines += [f"set {value >> 8}", f"store {name}", f"set {value & 0xFF}", f"store {name}+1"]
        for low, high in (("add", "addc"), ("sub", "subc")):
            lines += ["load x+1", f"{low} y+1", "give", "load x", f"{high} y", "give"]
        given = _run(_assembled("\n".join([*lines, "here:", "jump here"])), 20).given
        low_sum, high_sum, low_difference, high_difference = (byte for byte, _ in given)
        assert high_sum << 8 | low_sum == (left + right) % 0x10000
        assert high_difference << 8 | low_difference == (left - right) % 0x10000


def test_the_memory_has_nine_pages_and_the_globals() -> None:
    assert MEMORY_BYTES == 9 * 32 + 224
