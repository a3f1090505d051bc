"""Boards with a node of ROS 1 in a chip's sockets: the interpreter, and the hardware at the chip's pins."""

from __future__ import annotations

import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from ipaddress import IPv4Address
from pathlib import Path
from queue import Empty, SimpleQueue

from fusesoc_firm.fabric.ros1 import Endpoint, Node, Server, image
from fusesoc_firm.fabric.wiznet.chip import Status
from fusesoc_firm.fabric.wiznet.chips import MODELS
from fusesoc_firm.fabric.wiznet.w5200 import W5200
from fusesoc_firm.fabric.wiznet.w5500 import W5500
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import libraries
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.printer import closure_text
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.model import Host, Network
from tests.hdl.ghdl import core_files
from tests.hdl.verilator import compiled
from tests.hdl.verilog import netlist
from tests.shared import made_once
from tests.wiznet.sequencer import ABORTED, ACCESSES, LAST, Sequencer

HERE = Path(__file__).parent
*_HARDWARE, _LINK = core_files("axis/package", "cdc/sync", "net/wiznet", "net/wiznet_node")
_MS_PER_UNIT = 64
_IDLE_BYTES = 5  # of a turn without news
_IDLE_SECONDS = 0.002
_LONGEST_SECONDS = 60
# More at once is not the board's time, but the machine's. The bench plays them during the header of an SPI frame.
_MOST_MS = 5
# The bench counts the Manager's bytes in two bytes.
_MOST_OFFERED = 0xFFFF


def endpoint(topic: str, package: str, name: str) -> Endpoint:
    """A topic of a type of ROS 1."""
    message = MessageName(package, name)
    definitions = libraries((), None, None)[ROS1].closure(message)
    return Endpoint(topic, str(message), signature(message, definitions), closure_text(message, definitions))


def node(
    master: tuple[str, int],
    subscribers: tuple[Endpoint, ...],
    publishers: tuple[Endpoint, ...],
    services: tuple[Server, ...] = (),
    hosts: tuple[Host, ...] = (),
) -> Node:
    """A node `/fabric` at an address on loopback that only this process uses."""
    number = os.getpid() % 0x3FFFFF
    address = IPv4Address((127 << 24) + (0x400000 | number) + 1)
    mac, netmask = bytes.fromhex("020000000001"), IPv4Address("255.0.0.0")
    network = Network(mac, address, netmask, None, "fabric", "/", 0, hosts=hosts)
    return Node("/fabric", network, (IPv4Address(master[0]), master[1]), subscribers, publishers, services)


Accelerator = Callable[[int, bytes], Iterator[tuple[int, bytes]]]


@dataclass
class Manager:
    """Takes whole frames and answers with those of an accelerator: from ids and payloads to ids and payloads."""

    accelerator: Accelerator
    taken: list[tuple[int, bytes]] = field(default_factory=list)
    _frame: bytearray = field(default_factory=bytearray)

    def take(self, byte: int, is_last: bool) -> list[int]:
        """Take a byte; return the frames that answer."""
        self._frame.append(byte)
        if not is_last:
            return []
        frame, self._frame = bytes(self._frame), bytearray()
        payload = frame[5:]
        assert len(payload) == int.from_bytes(frame[1:5], "little")
        self.taken.append((frame[0], payload))
        return [word for answer in self.accelerator(frame[0], payload) for word in offer(framed(*answer))]


def framed(number: int, payload: bytes) -> bytes:
    """A frame of the Manager."""
    return bytes([number]) + len(payload).to_bytes(4, "little") + payload


def offer(frame: bytes) -> list[int]:
    """The bytes of a frame, with a mark on the last one."""
    return [*frame[:-1], frame[-1] + LAST]


class Board:
    """A running board in a thread. `turns` has the SPI bytes of each turn of an interpreter.

    The board's time is `clock.milliseconds`; `clock.rate` may be changed.
    """

    def __init__(self, run: Callable[[Board], None], chip: W5200 | W5500, manager: Manager) -> None:
        self.chip = chip
        self.manager = manager
        self.turns: list[int] = []
        self.clock = Clock()
        self.is_running = True
        self.to_offer: SimpleQueue[list[int]] = SimpleQueue()
        self._error: list[Exception] = []
        self._thread = threading.Thread(target=self._run, args=(run,), daemon=True)
        self._thread.start()

    def send(self, number: int, payload: bytes) -> None:
        """Offer a frame."""
        self.to_offer.put(offer(framed(number, payload)))

    def send_cut(self, number: int, payload: bytes, size: int) -> None:
        """Offer the first bytes of a frame, of which the last one aborts it."""
        *begin, last = offer(framed(number, payload)[:size])
        self.to_offer.put([*begin, last + ABORTED])

    def listening(self) -> int:
        """The number of sockets that listen."""
        return sum(item.status == Status.LISTEN for item in self.chip.sockets)

    def wait_until(self, is_true: Callable[[], bool]) -> None:
        """Wait until something has happened to the board."""
        latest = time.monotonic() + _LONGEST_SECONDS
        while not is_true():
            assert self._thread.is_alive(), self._error
            assert time.monotonic() < latest, [item.status.name for item in self.chip.sockets]
            time.sleep(0.005)

    def wait_until_listening(self) -> None:
        """Wait until all sockets but the first listen."""
        self.wait_until(lambda: self.listening() == 7)

    def offered(self) -> list[int]:
        """What has been offered since the last call."""
        data: list[int] = []
        while True:
            try:
                data += self.to_offer.get_nowait()
            except Empty:
                return data

    def stop(self) -> None:
        """Stop the board. Its connections remain."""
        self.is_running = False
        self._thread.join()
        if self._error:
            raise self._error[0]

    def close(self) -> None:
        """Stop the board and end its connections. It must not have misused its chip."""
        self.stop()
        misuses = self.chip.misuses
        self.chip.close()
        assert not misuses, misuses

    def _run(self, run: Callable[[Board], None]) -> None:
        try:
            run(self)
        except Exception as error:  # noqa: BLE001 - for the test's thread
            self._error.append(error)


def interpreted(board: Node, chip_number: int, manager: Manager, model: W5200 | W5500 | None = None) -> Board:
    """A board whose program the interpreter runs, on another model of the chip if one is given."""

    chip = model or MODELS[chip_number]()

    def run(running: Board) -> None:
        access, clock = ACCESSES[chip_number](chip), running.clock
        sequencer = Sequencer(image(board, chip_number), access, clock.units)
        while running.is_running:
            before = access.bytes
            sequencer.turn()
            running.turns.append(access.bytes - before)
            if running.turns[-1] <= _IDLE_BYTES:
                chip.poll(_IDLE_SECONDS)
            while sequencer.given:
                sequencer.offered.extend(manager.take(*sequencer.given.popleft()))
            sequencer.offered.extend(running.offered())

    return Board(run, chip, manager)


@dataclass
class Clock:
    """The board's time. It stands still while a busy machine lets the board wait, and with a `rate` of 0."""

    milliseconds: int = 0
    rate: int = 1
    _latest: int = field(default_factory=time.monotonic_ns)

    def units(self) -> int:
        """The present time in units of the sequencer."""
        self.pass_time()
        return self.milliseconds // _MS_PER_UNIT

    def pass_time(self) -> int:
        """Go on by the time since the last call, which is returned in ms."""
        passed = (time.monotonic_ns() - self._latest) // 1_000_000
        self._latest += passed * 1_000_000
        counted = self.rate * min(passed, _MOST_MS)
        self.milliseconds += counted
        return counted


@dataclass(frozen=True)
class Frame:
    """A frame of SPI with what the board got before it: milliseconds and bytes of the Manager."""

    milliseconds: int
    offered: list[int]
    sent: bytearray = field(default_factory=bytearray)
    answered: bytearray = field(default_factory=bytearray)


def _is_idle(before: Frame, frame: Frame) -> bool:
    """Whether a turn was as the one before it, and nothing came in between: the next one may come later."""
    return not frame.offered and (before.sent, before.answered) == (frame.sent, frame.answered)


def hardware(chip_number: int) -> Path:
    """The program of firm_wiznet_node's netlist, and its bench, which is compiled once in a run."""
    return made_once(f"wiznet_node_{chip_number}", partial(_build, chip_number)) / "model" / "Vfirm_wiznet_node"


def _build(chip_number: int, folder: Path) -> Path:
    verilog = netlist("firm_wiznet_node", folder, _HARDWARE[-1:], _HARDWARE[:-1], (), CHIP=chip_number, HALF_BIT=1)
    bench = (HERE / "node.cpp").read_text(encoding="ascii")
    return compiled(verilog.read_text(encoding="utf-8"), "firm_wiznet_node", bench, folder, (HERE,))


@dataclass(frozen=True)
class Stalls:
    """How the Manager stalls: in a percentage of the cycles, and if it is strict, while it offers something itself."""

    seed: int
    percent: int = 20
    is_strict: bool = False


def clocked(
    board: Node,
    chip_number: int,
    manager: Manager,
    program: Path,
    stalls: Stalls,
    log: list[Frame],
) -> Board:
    """A board whose program the hardware runs; each of its SPI frames is logged."""
    # Other processes of the run use the same program.
    rom = program.with_name(f"rom_{os.getpid()}")
    rom.write_bytes(image(board, chip_number))
    command = [str(program), str(rom), "0", "1", "0", str(stalls.percent), str(stalls.seed)]
    command += ["strict"] * stalls.is_strict

    chip = MODELS[chip_number]()

    def run(running: Board) -> None:
        clock, answers = running.clock, list[int]()
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
            assert process.stdin
            assert process.stdout
            while running.is_running:
                match process.stdout.read(1):
                    case b"s":
                        chip.select()
                        waiting = answers + running.offered()
                        offered, answers = waiting[:_MOST_OFFERED], waiting[_MOST_OFFERED:]
                        log.append(Frame(clock.pass_time(), offered))
                        words = [byte.to_bytes(2, "big") for byte in offered]
                        size = len(offered).to_bytes(2, "big")
                        process.stdin.write(bytes([log[-1].milliseconds]) + size + b"".join(words))
                        process.stdin.flush()
                    case b"a":
                        log[-1].answered.append(chip.answer())
                        process.stdin.write(log[-1].answered[-1:])
                        process.stdin.flush()
                    case b"t":
                        log[-1].sent.extend(process.stdout.read(1))
                        chip.take(log[-1].sent[-1])
                    case b"d":
                        chip.deselect()
                        if len(log) > 1 and not answers and _is_idle(*log[-2:]):
                            chip.poll(_IDLE_SECONDS)
                    case b"g" | b"l" as mark:
                        answers += manager.take(process.stdout.read(1)[0], mark == b"l")
                    case other:
                        raise AssertionError(f"the bench says {other!r}")
            process.kill()

    return Board(run, chip, manager)
