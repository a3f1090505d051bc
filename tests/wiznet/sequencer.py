"""The interpreter of the sequencer's instructions: the reference of `firm_wiznet_sequencer`, on a model of the chip."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol

from fusesoc_firm.fabric.sequencer import GLOBALS, MEMORY_BYTES, PAGE_BYTES, SOCKETS, Operation, Side, Space
from fusesoc_firm.fabric.wiznet.spi import Slave, exchange

_BUFFER = 2048
_WRITE = 0x80
_OPERAND_BITS = 6
_IMMEDIATE = 0x20
# Added to the last byte of a frame of the Manager, and to that of a frame that it aborts.
LAST, ABORTED = 0x100, 0x200


class Access(Protocol):
    """How a chip is read and written: space, socket and address, and the bytes to write or their number."""

    def read(self, space: int, socket: int, address: int, length: int) -> bytes:
        """Read bytes."""

    def write(self, space: int, socket: int, address: int, data: bytes) -> None:
        """Write bytes."""


class Access5500:
    """Accesses as SPI frames of a W5500. `bytes` counts their bytes."""

    def __init__(self, slave: Slave) -> None:
        self._slave = slave
        self.bytes = 0

    def read(self, space: int, socket: int, address: int, length: int) -> bytes:
        """Read bytes."""
        return self._frame([*self._header(space, socket, address, 0), *bytes(length)])[3:]

    def write(self, space: int, socket: int, address: int, data: bytes) -> None:
        """Write bytes."""
        self._frame([*self._header(space, socket, address, 4), *data])

    def _header(self, space: int, socket: int, address: int, control: int) -> list[int]:
        block = 0 if space == 0 else socket << 2 | space
        return [address >> 8, address & 0xFF, block << 3 | control]

    def _frame(self, sent: list[int]) -> bytes:
        self.bytes += len(sent)
        self._slave.select()
        received = bytes(exchange(self._slave, byte) for byte in sent)
        self._slave.deselect()
        return received


class Access5200(Access5500):
    """Accesses as SPI frames of a W5200: one for each side of a buffer's end."""

    def read(self, space: int, socket: int, address: int, length: int) -> bytes:
        """Read bytes."""
        return b"".join(
            self._frame([*place.to_bytes(2, "big"), *size.to_bytes(2, "big"), *bytes(size)])[4:]
            for place, size in self._parts(space, socket, address, length)
        )

    def write(self, space: int, socket: int, address: int, data: bytes) -> None:
        """Write bytes."""
        for place, size in self._parts(space, socket, address, len(data)):
            part, data = data[:size], data[size:]
            self._frame([*place.to_bytes(2, "big"), _WRITE | size >> 8, size & 0xFF, *part])

    def _parts(self, space: int, socket: int, address: int, length: int) -> list[tuple[int, int]]:
        if space < 2:
            return [(address if space == 0 else 0x4000 + 0x100 * socket + address, length)]
        begin, offset = (0x8000 if space == 2 else 0xC000) + _BUFFER * socket, address % _BUFFER
        first = min(length, _BUFFER - offset)
        return [(begin + offset, first), *([(begin, length - first)] if length > first else [])]


ACCESSES: dict[int, Callable[[Slave], Access5500]] = {5200: Access5200, 5500: Access5500}


class Sequencer:
    """The sequencer: its memory, and what it gives to the Manager (`given`) and takes from it (`offered`).

    `given` has bytes with a mark on the last one of each frame. `time` tells the present number of 64 ms.
    """

    def __init__(self, rom: bytes, access: Access, time: Callable[[], int]) -> None:
        self.memory = bytearray(MEMORY_BYTES)
        self.given: deque[tuple[int, bool]] = deque()
        self.offered: deque[int] = deque()
        self.turns = 0
        self._rom, self._access, self._time = rom, access, time
        self._own = self._page = SOCKETS
        self._a = self._pointer = self._text = self._count = self._next = 0
        self._zero = self._carry = self._is_aborted = False

    def turn(self) -> None:
        """Run until the ninth coroutine has its turn again."""
        turns = self.turns
        while self.turns == turns:
            self.step()

    def step(self) -> None:
        """Execute an instruction."""
        operation = Operation(self._fetch())
        operands = [self._fetch() for _ in range(operation >> _OPERAND_BITS)]
        match operation:
            case Operation.CALL:
                self._store_word(operands[0], self._next)
                self._next = operands[1] << 8 | operands[2]
            case Operation.READ | Operation.WRITE:
                self._transfer(operation is Operation.WRITE, *operands)
            case _ if operation >= Operation.JUMP:
                self._go(operation, operands[0] << 8 | operands[1])
            case _ if operation >= Operation.LOAD:
                self._with_byte(operation, operands[0])
            case _:
                self._alone(operation)

    def _fetch(self) -> int:
        self._next += 1
        return self._rom[self._next - 1]

    def _place(self, name: int) -> int:
        return self._page * PAGE_BYTES + name if name < PAGE_BYTES else GLOBALS + name

    def _word(self, name: int) -> int:
        return self.memory[self._place(name)] << 8 | self.memory[self._place(name + 1)]

    def _store_word(self, name: int, value: int) -> None:
        self.memory[self._place(name)], self.memory[self._place(name + 1)] = value >> 8 & 0xFF, value & 0xFF

    def _set(self, value: int) -> None:
        self._a = value & 0xFF
        self._zero = self._a == 0

    def _alone(self, operation: Operation) -> None:
        match operation:
            case Operation.YIELD:
                self._page = self._own
                self._store_word(0, self._next)
                self._own = self._page = 0 if self._own == SOCKETS else self._own + 1
                self._next = self._word(0)
                self.turns += self._own == SOCKETS
            case Operation.PAGE:
                self._page = self._a & 0xF
            case Operation.OWN:
                self._page = self._own
            case Operation.BIT:
                self._a = 1 << (self._page & 7)
            case Operation.TIME:
                self._a = self._time() & 0xFF
            case Operation.FETCH:
                self._set(self._rom[self._text])
                self._text += 1
            case Operation.COUNT:
                self._count = self._a
            case Operation.TAKE:
                self._a = self._taken()
            case Operation.GIVE | Operation.GIVE_LAST:
                self.given.append((self._a, operation is Operation.GIVE_LAST))

    def _taken(self) -> int:
        """The next byte of the Manager, or 0 after an abort."""
        if self._is_aborted:
            return 0
        taken = self.offered.popleft()
        self._is_aborted = taken >= ABORTED
        return taken & 0xFF

    def _with_byte(self, operation: Operation, operand: int) -> None:
        if operation & _IMMEDIATE:
            self._compute(Operation(operation & ~_IMMEDIATE), operand)
        elif operation < Operation.STORE:
            self._compute(operation, self.memory[self._place(operand)])
        elif operation is Operation.STORE:
            self.memory[self._place(operand)] = self._a
        elif operation is Operation.FILL:
            for index in range(self._count):
                self.memory[self._place(operand) + index] = self._taken()
        else:
            self._with_word(operation, operand)

    def _compute(self, operation: Operation, value: int) -> None:
        a, carry = self._a, self._carry
        totals = {
            Operation.ADD: a + value,
            Operation.ADDC: a + value + carry,
            Operation.SUB: a - value,
            Operation.COMPARE: a - value,
            Operation.SUBC: a - value - carry,
        }
        if operation in totals:
            self._carry = not 0 <= totals[operation] <= 0xFF
        others = {Operation.LOAD: value, Operation.AND: a & value, Operation.OR: a | value}
        self._set({**totals, **others}[operation])
        if operation is Operation.COMPARE:
            self._a = a

    def _with_word(self, operation: Operation, operand: int) -> None:
        match operation:
            case Operation.RETURN:
                self._next = self._word(operand)
            case Operation.POINT:
                self._pointer = self._word(operand)
            case Operation.POINTED:
                self._store_word(operand, self._pointer)
            case Operation.TEXT:
                self._text = self._word(operand)
            case Operation.TEXTED:
                self._store_word(operand, self._text)
            case Operation.MATCH:
                self._store_word(operand, self._matched(self._word(operand)))
            case Operation.MATCHED:
                self._set(self._number(self._word(operand)))

    def _matched(self, place: int) -> int:
        """The place in the trie after the character in a; 0 if no string goes on with it."""
        if place == 0:
            return 0
        while self._rom[place] & 0x80:
            if self._rom[place] & 0x7F == self._a:
                return self._rom[place + 1] << 8 | self._rom[place + 2]
            place += 3
        return place + 1 if self._rom[place] == self._a != 0 else 0

    def _number(self, place: int) -> int:
        if place == 0:
            return 0
        while self._rom[place] & 0x80:
            place += 3
        return self._rom[place + 1] if self._rom[place] == 0 else 0

    def _go(self, operation: Operation, address: int) -> None:
        conditions = {
            Operation.JUMP: True,
            Operation.JUMP_ZERO: self._zero,
            Operation.JUMP_NOT_ZERO: not self._zero,
            Operation.JUMP_CARRY: self._carry,
            Operation.JUMP_NOT_CARRY: not self._carry,
            Operation.JUMP_FRAME: bool(self.offered) or self._is_aborted,
            Operation.JUMP_BUSY: False,  # all that is given is taken at once
            Operation.JUMP_ABORTED: self._is_aborted,
        }
        if operation is Operation.JUMP_ABORTED:
            self._is_aborted = False
        if operation is Operation.AT:
            self._text = address
        elif operation is Operation.LOOKUP:
            self._set(self._rom[address + self._a])
        elif conditions[operation]:
            self._next = address

    def _transfer(self, is_write: bool, kind: int, register: int, name: int) -> None:
        space, side = Space(kind & 0xC0), Side(kind & 0x30)
        is_buffer = space >= Space.TRANSMIT
        address, length = (self._pointer, self._count) if is_buffer else (register, (kind & 0xF) + 1)
        target = space >> 6, self._page & 7, address
        begin = self._place(name)
        if is_write:
            source = self._rom[self._text :] if side is Side.ROM else self.memory[begin:]
            self._access.write(*target, bytes(source[:length]))
        else:
            data = self._access.read(*target, length)
            if side is Side.MEMORY:
                self.memory[begin : begin + length] = data
            else:
                is_last = side is Side.MANAGER_LAST
                self.given.extend((byte, is_last and index == length - 1) for index, byte in enumerate(data))
        if side is Side.ROM:
            self._text += length
        if is_buffer:
            self._pointer = (self._pointer + length) & 0xFFFF
