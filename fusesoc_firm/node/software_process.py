"""A system's functions in a process of their own, which takes frames at its standard input and gives frames back.

    python3 -m fusesoc_firm.node.software_process robot.yaml

So a node in C++ runs blocks of type ROS-SW: to it they are a transport as the hardware is (`software:COMMAND`,
docs/reference/node-library.md). The ids are the software's own, in the order of `software_ports`. The end of the input
is the end of the process, with status 0, when all is answered. What the functions print goes to standard error.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from fusesoc_firm.frame.codec import CodecError, decode, pack_frame
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.simulation.functions import Functions, Message, importable_sources
from fusesoc_firm.system.derived.model import DerivedSystem, End, Topic
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.diagnostics import InputError, fail

_HEADER_BYTES = ID_BYTES + LENGTH_BYTES


@dataclass(frozen=True)
class SoftwarePorts:
    """What goes into a system's functions and comes out of them; the place in each is the id in frames.

    In: the topics that they take, then the hardware's publishers that stand for their inputs. Out: the hardware's
    subscribers that stand for their outputs, then the topics that they publish.
    """

    inputs: tuple[Topic, ...]
    outputs: tuple[Topic, ...]


def software_ports(system: DerivedSystem) -> SoftwarePorts:
    """The ports of the blocks with sources; others are software elsewhere."""
    software = system.software
    here = {block.block for block in software.blocks if block.type.accelerator.sources}
    taken, given = set(), set()
    for connection in software.connections:
        sinks = {sink.block for sink in connection.sinks}
        if sinks & here:
            taken.add(connection.source.block)
        if connection.source.block in here:
            given |= sinks
    inputs = (*software.subscribers, *(item for item in system.publishers if item.software))
    outputs = (*(item for item in system.subscribers if item.software), *software.publishers)
    return SoftwarePorts(
        tuple(topic for topic in inputs if topic.block in taken),
        tuple(topic for topic in outputs if topic.block in given),
    )


def serve(system: DerivedSystem, folder: Path, taken: BinaryIO, given: BinaryIO) -> None:
    """Answer frames until the input ends. Raises `InputError` for a fault of a function, or of the frames' row.

    A payload that is no message is told on standard error, and the rest goes on.
    """
    ports = software_ports(system)
    ids = {topic.block: number for number, topic in enumerate(ports.outputs)}
    with importable_sources([type_.accelerator for type_ in system.software.types], folder):
        functions = Functions.of(system.software, folder)
        for identifier, payload in _frames(taken, len(ports.inputs)):
            topic = ports.inputs[identifier]
            try:
                message = decode(topic.frame, payload)
            except CodecError as error:
                print(f"invalid message from '{topic.block}': {error}", file=sys.stderr, flush=True)
                continue
            answers = functions.take(End(topic.block), message)
            given.writelines(_framed(ids[block], ports.outputs[ids[block]], answer) for block, answer in answers)
            given.flush()


def _framed(identifier: int, topic: Topic, message: Message) -> bytes:
    return pack_frame(identifier, encode_used(topic.frame, message))


def _frames(row: BinaryIO, ids: int) -> Iterator[tuple[int, bytes]]:
    while header := row.read(_HEADER_BYTES):
        length = int.from_bytes(header[ID_BYTES:], "little")
        if len(header) < _HEADER_BYTES or len(payload := row.read(length)) < length:
            fail("the input ends within a frame")
        if header[0] >= ids:
            fail(f"a frame has id {header[0]}, but the software's inputs have the ids 0 to {ids - 1}")
        yield header[0], payload


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; its exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spec", type=Path, help="the specification of the system")
    parser.add_argument("--path", type=Path, action="append", default=[], metavar="DIR", help="message definitions")
    parser.add_argument("--distro", metavar="NAME", help="the ROS distribution that provides the standard messages")
    given = parser.parse_args(arguments)
    # Nothing but frames may come out there, whatever the functions print.
    frames = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        loaded = load_beside(given.spec, given.path, given.distro)
        serve(loaded.system, loaded.folder, sys.stdin.buffer, frames)
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except BrokenPipeError:
        # Who asked is gone; nobody is left to be told.
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
