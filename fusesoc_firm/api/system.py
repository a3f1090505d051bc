"""A system in simulation, for scripts and notebooks.

system = System("tilt.yaml")
for answer in system.simulate([{"sub": {"linear_acceleration": {"x": 9.81}}}]):
    print(answer.publisher, answer.message, answer.cycles)

with system.start() as run:                     # one message at a time
    answers = run.send("sub", {"linear_acceleration": {"x": 9.81}})
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from fusesoc_firm.accelerator.functions import Functions, importable_sources
from fusesoc_firm.api.codec import Codec
from fusesoc_firm.builds.project import message_folders
from fusesoc_firm.frame.codec import MessageValue
from fusesoc_firm.node.transport.built_simulator import CoreSources, build_simulator
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.runs.replay.hardware_run import Sent, StuckError, SystemRun, published
from fusesoc_firm.runs.simulation.software_run import stimulated, system_stimuli
from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import fail, nearest

QUIET_CYCLES = 1000
"""The default number of cycles without a beat after which a system is at rest, as in `firm replay`."""

Named = TypeVar("Named")
Stimuli = str | Path | MessageValue | Iterable[MessageValue]
"""A file of stimuli or a bag, a dictionary of subscribers with a message each, or several of them in order."""


class SimulationError(Exception):
    """The simulated hardware rejected a message, sent invalid data, or does not accept messages any more."""


@dataclass(frozen=True)
class Answer:
    """A message that a system sent.

    `cause` is the number of the sent message, from 0, that caused it. `cycles` of the clock pass from that message's
    first beat into the hardware to the answer's last beat; None if one of them bypasses the hardware. `seconds` is the
    same time; None without `cycles`, or if the specification has no clock.
    """

    publisher: str
    message: dict[str, Any]
    cause: int
    cycles: int | None
    seconds: float | None


class System:
    """The system of a specification, which `firm sim` simulates, too.

    `subscribers` and `publishers` are the codecs of its inputs and outputs, by the names of their blocks.
    """

    def __init__(self, spec: str | Path, paths: Iterable[str | Path] = (), distro: str | None = None) -> None:
        """Read a specification; `paths` and `distro` are further sources of messages, as for `codec`.

        Raise `InputError` with all faults in the specification.
        """
        self._spec = Path(spec)
        self._sources = CoreSources([Path(path) for path in paths], distro or "", core_folders=message_folders)
        self._loaded = load_beside(self._spec, self._sources.paths, distro, core_folders=message_folders)
        self.name = self._loaded.system.name
        self.subscribers = _codecs(self._loaded, stimulated(self._loaded.system))
        self.publishers = _codecs(self._loaded, published(self._loaded.system))

    def __repr__(self) -> str:
        return f"<system {self.name}: {', '.join(self.subscribers)} to {', '.join(self.publishers)}>"

    def simulate(
        self,
        stimuli: Stimuli,
        *,
        tool: str | None = None,
        seed: int = 1,
        stall_percent: int = 0,
        quiet: int = QUIET_CYCLES,
    ) -> list[Answer]:
        """Send messages to the simulated system, one after the other, and return its answers.

        `stimuli` is a dictionary of subscribers with a message each, several of them in order, or the path of a file of
        stimuli or a bag. The options and errors are those of `start` and `Run.send`.
        """
        payloads = self._payloads(stimuli)
        with self.start(tool=tool, seed=seed, stall_percent=stall_percent, quiet=quiet) as run:
            return [answer for block, payload in payloads for answer in run.send_payload(block, payload)]

    def start(
        self, *, tool: str | None = None, seed: int = 1, stall_percent: int = 0, quiet: int = QUIET_CYCLES
    ) -> Run:
        """Build the simulator, or rebuild its changed parts, and start it.

        The host stalls the streams in `stall_percent` of the cycles, which `seed` selects. The system has answered a
        message after `quiet` cycles without a beat. Raise `InputError` if the system cannot be built, and
        `SimulationError` if its simulator cannot be started.
        """
        built = build_simulator(self._spec, tool, sources=self._sources)
        return Run(self._loaded, built.command(seed=seed, stall_percent=stall_percent), built.folder, quiet)

    def _payloads(self, stimuli: Stimuli) -> list[tuple[str, bytes]]:
        if isinstance(stimuli, str | Path):
            return [(item.subscriber.block, item.payload) for item in system_stimuli(Path(stimuli), self._loaded)]
        items = [stimuli] if isinstance(stimuli, Mapping) else stimuli
        return [
            (block, _known(block, self.subscribers).encode(message))
            for item in items
            for block, message in item.items()
        ]


class Run:
    """A running simulation of a system, which a `with` statement ends."""

    def __init__(self, loaded: LoadedSystem, command: Sequence[str], folder: Path, quiet: int) -> None:
        """Start a simulator; `System.start` has the arguments."""
        system = loaded.system
        self._subscribers = {topic.block: topic for topic in stimulated(system)}
        self._inputs = _codecs(loaded, self._subscribers.values())
        self._outputs = _codecs(loaded, published(system))
        self._clock = system.clock
        self._sent = 0
        self._has_ended = False
        with ExitStack() as stack, _told():
            accelerators = [type_.accelerator for type_ in system.software.types]
            stack.enter_context(importable_sources(accelerators, loaded.folder))
            functions = Functions.of(system.software, loaded.folder)
            self._simulator = stack.enter_context(Simulator(command, folder))
            self._run = SystemRun(system, self._simulator, functions, quiet)
            self._open = stack.pop_all()

    def send(self, subscriber: str, message: MessageValue) -> list[Answer]:
        """Send a message, run until the system is at rest, and return its answers.

        Raise `CodecError` for a message that does not fit, `InputError` for an unknown subscriber, and
        `SimulationError` for a fault that the hardware reports.
        """
        return self.send_payload(subscriber, _known(subscriber, self._inputs).encode(message))

    def send_payload(self, subscriber: str, payload: bytes) -> list[Answer]:
        """Send an encoded message, like `send`."""
        _known(subscriber, self._subscribers)
        if self._has_ended:
            raise SimulationError("the simulation has ended")
        number, self._sent = self._sent, self._sent + 1
        with _told():
            self._run.take(self._subscribers[subscriber], payload, number)
        answers = [self._answer(sent) for sent in self._run.sent]
        self._run.sent.clear()
        if faults := [*self._run.faults]:
            self._run.faults.clear()
            raise SimulationError(f"message {number} to '{subscriber}': {'; '.join(faults)}")
        return answers

    def close(self) -> None:
        """End the simulation; a second call does nothing.

        Raise `SimulationError` if it does not end normally, or within a frame.
        """
        if self._has_ended:
            return
        self._has_ended = True
        with self._open, _told():
            self._simulator.quit()
        if self._run.unfinished:
            raise SimulationError(self._run.unfinished)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._has_ended = True
            self._open.close()

    def _answer(self, sent: Sent) -> Answer:
        block = sent.topic.block
        seconds = None if sent.cycles is None or self._clock is None else float(sent.cycles / self._clock)
        # The stamp of a cause is the number of its message.
        return Answer(block, self._outputs[block].decode(sent.payload), sent.cause.stamp, sent.cycles, seconds)


@contextmanager
def _told() -> Iterator[None]:
    """Convert the errors of a simulator to `SimulationError`."""
    try:
        yield
    except (StuckError, TransportError) as error:
        raise SimulationError(str(error)) from error


def _codecs(loaded: LoadedSystem, topics: Iterable[Topic]) -> dict[str, Codec]:
    return {
        topic.block: Codec(
            topic.frame.message, loaded.libraries[topic.frame.ros].closure(topic.frame.message), topic.frame
        )
        for topic in topics
    }


def _known(block: str, items: Mapping[str, Named]) -> Named:
    """Return the item of a block. Raise `InputError` for an unknown block."""
    if block not in items:
        fail(f"'{block}' is not a subscriber", hint=nearest(block, items))
    return items[block]
