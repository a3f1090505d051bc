"""The instructions of `firm_wiznet_sequencer`, and the assembler that creates its memory from a program and texts.

The sequencer runs nine coroutines in turn: one for each socket of the chip, and one for shared tasks. Each has a page
of 32 bytes, whose first two contain the address at which it continues. The rest of the memory is global. The two
highest bits of an instruction are the number of the bytes that follow it. Addresses and fields of 16 bits are
big-endian.

A program is text. Each line is `label:`, an instruction with its operands, or a declaration:

    local NAME BYTES          a field in each page
    global NAME BYTES         a field that all coroutines share
    alias NAME FIELD[+N]      another name of a field, or of a part of it
    constant NAME VALUE

Operands are numbers, names, `FIELD+N`, and `>LABEL` and `<LABEL` (the high and the low byte of an address).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

PAGE_BYTES = 32
SOCKETS = 8
# The ninth coroutine's page follows those of the sockets; a field of all coroutines is addressed from there.
GLOBALS = SOCKETS * PAGE_BYTES
MEMORY_BYTES = 512


class Operation(IntEnum):
    """The instructions.

    `a` is the accumulator, `f` a field, `ff` one of 16 bits, `n` a number, `p` the pointer in a buffer of the chip, `t`
    the pointer in the ROM; `z` and `c` are flags.
    """

    YIELD = 0x00  # store the address, continue with the next coroutine
    PAGE = 0x01  # fields and socket are those of page a
    OWN = 0x02  # fields and socket are the coroutine's own again
    BIT = 0x03  # a := 2 to the power of the page
    TIME = 0x04  # a := time in units of 64 ms
    FETCH = 0x05  # a := ROM at t, t := t + 1, z
    COUNT = 0x06  # the length of a transfer with a buffer := a
    TAKE = 0x07  # a := byte of the Manager
    GIVE = 0x08  # byte to the Manager: a
    GIVE_LAST = 0x09  # the same, the last of its frame
    LOAD = 0x40  # a := f, z
    ADD = 0x41  # a := a + f, z, c
    SUB = 0x42  # a := a - f; z, c if it is negative
    COMPARE = 0x43  # z, c of a - f
    AND = 0x44  # a := a and f, z
    OR = 0x45  # a := a or f, z
    ADDC = 0x46  # a := a + f + c, z, c
    SUBC = 0x47  # a := a - f - c, z, c
    STORE = 0x48  # f := a
    RETURN = 0x50  # continue at ff
    POINT = 0x51  # p := ff
    TEXT = 0x52  # t := ff
    MATCH = 0x53  # ff, a place in a trie, advances by a
    MATCHED = 0x54  # a := number of the string that ends at ff, or 0, z
    POINTED = 0x55  # ff := p
    TEXTED = 0x56  # ff := t
    FILL = 0x57  # COUNT bytes of the Manager to f and following
    SET = 0x60  # the same with a number n for f
    ADDI = 0x61
    SUBI = 0x62
    COMPAREI = 0x63
    ANDI = 0x64
    JUMP = 0x80
    JUMP_ZERO = 0x81
    JUMP_NOT_ZERO = 0x82
    JUMP_CARRY = 0x83
    JUMP_NOT_CARRY = 0x84
    JUMP_FRAME = 0x85  # if the Manager offers the next 64 bytes of a frame, or its end
    AT = 0x86  # t := address
    LOOKUP = 0x87  # a := ROM at address + a, z
    JUMP_ABORTED = 0x88  # if the Manager has aborted its frame, whose missing bytes were zeros until now
    JUMP_BUSY = 0x89  # if the Manager has not yet accepted all bytes; otherwise, there is room for 64
    CALL = 0xC0  # ff := the next instruction's address, continue at address
    READ = 0xC1  # bytes of the chip to f: kind, register, f
    WRITE = 0xC2  # bytes to the chip: kind, register, f


class Space(IntEnum):
    """The address spaces of the chip: the two highest bits of a transfer's kind.

    The lowest four bits are the number of bytes less one. With a buffer, p is the address, and COUNT the number.
    """

    COMMON = 0x00
    SOCKET = 0x40
    TRANSMIT = 0x80
    RECEIVE = 0xC0


class Side(IntEnum):
    """The other side of a transfer: two bits of its kind."""

    MEMORY = 0x00
    ROM = 0x10  # at t
    MANAGER = 0x20
    MANAGER_LAST = 0x30  # the last byte ends the frame


class AssemblyError(Exception):
    """An error in a program; the text contains the line."""


# Marks in a trie. A place is a character, a choice (a character and the place that follows it), or an end.
_END, _CHOICE = 0x00, 0x80


def trie(strings: Mapping[bytes, int]) -> tuple[bytes, list[int]]:
    """Return a trie of printable strings with their numbers, 1 to 255, and the offsets of its addresses.

    An address in the trie is relative to the trie's begin.
    """
    text = bytearray()
    addresses: list[int] = []

    def add(items: list[tuple[bytes, int]]) -> None:
        groups: dict[int, list[tuple[bytes, int]]] = {}
        ends = [number for string, number in items if not string]
        for string, number in items:
            if string:
                groups.setdefault(string[0], []).append((string[1:], number))
        inline = None if ends or not groups else list(groups)[-1]
        places: list[tuple[int, int]] = []
        for first in groups:
            if first != inline:
                text.append(_CHOICE | first)
                places.append((first, len(text)))
                addresses.append(len(text))
                text.extend(bytes(2))
        if inline is None:
            text.extend([_END, ends[0]] if ends else [_END, 0])
        else:
            text.append(inline)
            add(groups[inline])
        for first, place in places:
            text[place : place + 2] = len(text).to_bytes(2, "big")
            add(groups[first])

    add(sorted(strings.items()))
    return bytes(text), addresses


@dataclass
class Rom:
    """The memory while it is assembled: bytes, and the places of missing label addresses."""

    text: bytearray = field(default_factory=bytearray)
    labels: dict[str, int] = field(default_factory=dict)
    fixes: list[tuple[int, str, str]] = field(default_factory=list)  # place, label, part: '', '>' or '<'

    def label(self, name: str) -> None:
        """Define a label at the current address."""
        if name in self.labels:
            raise AssemblyError(f"label '{name}' is there twice")
        self.labels[name] = len(self.text)

    def add(self, data: bytes | Iterable[int]) -> None:
        """Append bytes."""
        self.text.extend(data)

    def address(self, label: str, part: str = "") -> None:
        """Append the address of a label, or a byte of it."""
        self.fixes.append((len(self.text), label, part))
        self.text.extend(bytes(1 if part else 2))

    def add_trie(self, name: str, strings: Mapping[bytes, int]) -> None:
        """Append a trie."""
        self.label(name)
        text, addresses = trie(strings)
        begin = len(self.text)
        self.add(text)
        for place in (begin + offset for offset in addresses):
            relative = int.from_bytes(self.text[place : place + 2], "big")
            self.text[place : place + 2] = (begin + relative).to_bytes(2, "big")

    def add_table(self, name: str, labels: Iterable[str]) -> None:
        """Append two tables, NAME_high and NAME_low, with the bytes of the labels' addresses."""
        wanted = list(labels)
        for suffix, part in (("high", ">"), ("low", "<")):
            self.label(f"{name}_{suffix}")
            for label in wanted:
                self.address(label, part)

    def image(self) -> bytes:
        """Return the bytes with all addresses. Raise `AssemblyError` if a label is missing."""
        for place, label, part in self.fixes:
            if label not in self.labels:
                raise AssemblyError(f"label '{label}' is missing")
            value = self.labels[label].to_bytes(2, "big")
            if part:
                self.text[place] = value[0 if part == ">" else 1]
            else:
                self.text[place : place + 2] = value
        return bytes(self.text)


_ADDRESSED = {
    Operation.JUMP,
    Operation.JUMP_ZERO,
    Operation.JUMP_NOT_ZERO,
    Operation.JUMP_CARRY,
    Operation.JUMP_NOT_CARRY,
    Operation.JUMP_FRAME,
    Operation.JUMP_ABORTED,
    Operation.JUMP_BUSY,
    Operation.AT,
    Operation.LOOKUP,
}
_LABEL = re.compile(r"(\w+):")
_OPERAND = re.compile(r"([<>]?)(\w+)(?:\+(\d+))?")


class Assembler:
    """Reads a program and appends its instructions to a ROM."""

    def __init__(self, rom: Rom, constants: Mapping[str, int]) -> None:
        """`constants` are further names for the program."""
        self._rom = rom
        self.names = dict(constants)
        self._next = {"local": 0, "global": PAGE_BYTES}

    def read(self, program: str) -> None:
        """Append a program. Raise `AssemblyError` for an invalid line."""
        for number, line in enumerate(program.splitlines(), 1):
            words = line.partition(";")[0].split()
            try:
                self._line(words)
            except (KeyError, ValueError, IndexError) as error:
                raise AssemblyError(f"line {number}: '{line.strip()}' is not possible: {error}") from None

    def _line(self, words: list[str]) -> None:
        match words:
            case []:
                pass
            case [label] if found := _LABEL.fullmatch(label):
                self._rom.label(found[1])
            case ["local" | "global" as kind, name, size]:
                self._declare(name, self._next[kind])
                self._next[kind] += int(size)
                if self._next[kind] > (PAGE_BYTES if kind == "local" else MEMORY_BYTES - GLOBALS):
                    raise ValueError("there is no room")
            case ["alias" | "constant", name, value]:
                self._declare(name, self._value(value))
            case [name, *operands]:
                self._instruction(Operation[name.upper()], operands)

    def _declare(self, name: str, value: int) -> None:
        if name in self.names:
            raise ValueError("the name is there twice")
        self.names[name] = value

    def _instruction(self, operation: Operation, operands: list[str]) -> None:
        self._rom.add([operation])
        if operation in _ADDRESSED:
            (label,) = operands
            self._rom.address(label)
        elif operation is Operation.CALL:
            link, label = operands
            self._rom.add([self._value(link)])
            self._rom.address(label)
        elif operation in {Operation.READ, Operation.WRITE}:
            self._rom.add(self._transfer(operands))
        else:
            if len(operands) != operation >> 6:
                raise ValueError(f"it has {operation >> 6} operands")
            for operand in operands:
                self._byte(operand)

    def _transfer(self, operands: list[str]) -> Iterator[int]:
        """`SPACE SIDE BYTES REGISTER [FIELD]`, or with a buffer `SPACE SIDE [FIELD]`."""
        space, side = Space[operands[0].upper()], Side[operands[1].upper()]
        rest = [self._value(word) for word in operands[2:]]
        size, register = (1, 0) if space >= Space.TRANSMIT else (rest.pop(0), rest.pop(0))
        yield space | side | size - 1
        yield register
        yield rest.pop(0) if side is Side.MEMORY else 0
        if rest or not 1 <= size <= 16:
            raise ValueError("a transfer has another form")

    def _byte(self, word: str) -> None:
        found = _OPERAND.fullmatch(word)
        if found and found[1]:
            self._rom.address(found[2], found[1])
        else:
            self._rom.add([self._value(word)])

    def _value(self, word: str) -> int:
        if re.fullmatch(r"'.'", word):
            return ord(word[1])
        found = _OPERAND.fullmatch(word)
        if not found or found[1]:
            raise ValueError(f"'{word}' is not a value")
        value = self.names[found[2]] if found[2] in self.names else int(found[2], 0)
        return value + int(found[3] or 0)
