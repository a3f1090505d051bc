"""Run a system's software in a node: decode payloads, call the functions, and encode the results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock

from fusesoc_firm.accelerator.functions import Functions, Message, importable_sources
from fusesoc_firm.accelerator.software import sent_elsewhere, taken_elsewhere
from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.system.derived.model import End
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import InputError, fail


@dataclass
class NodeSoftware:
    """A system's blocks of type ROS-SW that have sources.

    Messages come from blocks (topics or converters), and the functions' outputs go to other blocks. `report` receives
    each fault. The messages of a failed call are lost; all other calls continue.
    """

    functions: Functions
    report: Callable[[InputError], None]
    sources: dict[str, tuple[End, Frame]]
    sinks: dict[str, Frame]
    faults: int = 0
    _lock: Lock = field(default_factory=Lock)

    def take(self, block: str, payload: bytes) -> list[tuple[str, bytes]]:
        """Process a message from a block; return the resulting payloads, each with its destination block."""
        end, frame = self.sources[block]
        with self._lock:
            return list(self._run(block, end, frame, payload))

    def _run(self, block: str, end: End, frame: Frame, payload: bytes) -> Iterator[tuple[str, bytes]]:
        step: Callable[[], list[tuple[str, Message]]]
        step = lambda: self.functions.take(end, _decoded(block, frame, payload))  # noqa: E731
        while True:
            try:
                for name, message in step():
                    yield name, encode_used(self.sinks[name], message)
            except InputError as error:
                self.faults += 1
                self.report(error)
                step = self.functions.run
            else:
                return


@contextmanager
def node_software(loaded: LoadedSystem, report: Callable[[InputError], None]) -> Iterator[NodeSoftware | None]:
    """Load a system's software, or None without software; within this context, sources can import each other.

    May raise `InputError`, also for a fault within a source file.
    """
    system, software = loaded.system, loaded.system.software
    if not any(block.type.accelerator.sources for block in software.blocks):
        yield None
        return
    taken = taken_elsewhere(system)
    with importable_sources([type_.accelerator for type_ in software.types], loaded.folder):
        functions = Functions.of(software, loaded.folder, {end: topic.block for topic, end in taken.items()})
        topics = (*system.subscribers, *system.publishers, *software.subscribers)
        ends = {topic.block: (End(topic.block), topic.frame) for topic in topics}
        ends |= {topic.block: (end, topic.frame) for topic, end in sent_elsewhere(system).items()}
        # An output from hardware to software in another program is a topic, not an input of a function here.
        outside = {topic.block for topic in taken}
        yield NodeSoftware(
            functions,
            report,
            {block: found for block, found in ends.items() if found[0] in functions.ways and block not in outside},
            {topic.block: topic.frame for topic in (*system.subscribers, *software.publishers, *taken)},
        )


def _decoded(block: str, frame: Frame, payload: bytes) -> Message:
    try:
        return decode(frame, payload)
    except CodecError as error:
        fail(f"a message from '{block}' is not a valid {frame.message} message: {error}")
