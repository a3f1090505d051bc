"""Run a system's functions in a separate process, with frames on its standard input and output.

    python3 -m fusesoc_firm.node.software_process robot.yaml

A C++ node uses this process for blocks of type ROS-SW, through a transport like the hardware's (`software:COMMAND`,
docs/reference/node-library.md). The software has its own ids, in the order of `software_ports`. At the end of the
input, the process finishes all messages and exits with status 0. Output that the functions print goes to standard
error.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from fusesoc_firm.accelerator.functions import Functions, Message, importable_sources
from fusesoc_firm.frame.codec import CodecError, decode, pack_frame
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.system.derived.model import DerivedSystem, End, Topic
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.diagnostics import InputError, fail

_HEADER_BYTES = ID_BYTES + LENGTH_BYTES


@dataclass(frozen=True)
class SoftwarePorts:
    """The inputs and outputs of a system's functions; the index of each is its id in frames.

    The inputs are the topics that the functions receive, then the publishers in hardware that feed functions. The
    outputs are the subscribers in hardware that functions feed, then the topics that the functions publish.
    """

    inputs: tuple[Topic, ...]
    outputs: tuple[Topic, ...]


def software_ports(system: DerivedSystem) -> SoftwarePorts:
    """Return the ports of the blocks with sources; blocks without sources are software in other programs."""
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
    """Read frames from `taken` and write frames to `given` until the input ends.

    A payload that is not a message is reported on standard error and skipped. Raise `InputError` for a fault in a
    function or in the stream of frames.
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
            fail(f"a frame has the id {header[0]}, but the software's inputs have the ids 0 to {ids - 1}")
        yield header[0], payload


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spec", type=Path, help="the system's YAML specification")
    parser.add_argument("--path", type=Path, action="append", default=[], metavar="DIR", help="message definitions")
    parser.add_argument("--distro", metavar="NAME", help="the ROS distribution that provides the standard messages")
    given = parser.parse_args(arguments)
    # Standard output carries only frames, so the functions' output is redirected.
    frames = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        loaded = load_beside(given.spec, given.path, given.distro)
        serve(loaded.system, loaded.folder, sys.stdin.buffer, frames)
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader has ended, so a report would have no recipient.
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
