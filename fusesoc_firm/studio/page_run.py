"""A run that the page watches, and the run that the page starts: a simulation with its core's stimuli."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from fusesoc_firm.accelerator.software import taken_elsewhere
from fusesoc_firm.core.core_reader import CoreFile
from fusesoc_firm.node.engine.carrier import CarrierError
from fusesoc_firm.node.engine.player import Player
from fusesoc_firm.node.engine.queues import Overflow
from fusesoc_firm.node.engine.software import node_software
from fusesoc_firm.node.engine.watch import Control, Watch
from fusesoc_firm.node.interface.description import NodeDescription, describe
from fusesoc_firm.node.node import Node, NodeSettings
from fusesoc_firm.node.reopening import checked, of_simulator
from fusesoc_firm.node.transport.built_simulator import BuiltSimulator
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.runs.simulation.software_run import stimulated, system_stimuli
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.system.hardware.waits import wires
from fusesoc_firm.system.message_sources import core_of
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import InputError, fail

BUILDING, RUNNING, ENDED, FAILED = "building", "running", "ended", "failed"
# The limits of the silence and of the whole time in which the last messages leave the system: simulated hardware may
# take minutes for a large message, and the user can stop the run.
_SETTLE_SECONDS, _DRAIN_SECONDS = 0.2, 600.0
# The seconds in which messages may still leave the system after the user stops a run.
_STOP_SECONDS = 4.0
# The seconds in which a run may still end when the server ends; its simulator then ends anyway.
_END_SECONDS = 5.0

Build = Callable[[Path, str], BuiltSimulator]
"""Builds the simulator of a specification in a tool. May raise `InputError`."""


class Run:
    """A run of the system of a specification: its record, its state, and its control, if it can be paused.

    `text` contains the reason of a failure, or the counts at the end.
    """

    def __init__(self, loaded: LoadedSystem, spec: Path, title: str, control: Control | None = None) -> None:
        """Begin a record; another part of the program performs the run itself."""
        self.spec, self.title, self.control = spec.resolve(), title, control
        self.system, self.libraries = loaded.system, loaded.libraries
        self.watch = Watch()
        self.wires = wires(loaded.system)
        self.state, self.text = RUNNING, ""

    @property
    def topics(self) -> Mapping[str, Topic]:
        """The topics of all messages that the record may contain, by block."""
        system = self.system
        topics = [*stimulated(system), *taken_elsewhere(system), *system.software.publishers]
        topics += [*system.subscribers, *system.publishers]
        return {topic.block: topic for topic in topics}

    def end(self, text: str = "", state: str = ENDED) -> None:
        """Record the end of the run."""
        self.state, self.text = state, text

    def stop(self) -> None:
        """End the run, if that is possible from here."""

    def wait(self) -> None:
        """Wait until the run has ended after `stop`."""


@dataclass(frozen=True)
class Wishes:
    """The page's options of a simulation: `rate` in messages per second, 0 for as many as the system accepts.

    The stimuli are repeated if `is_endless` is set; the run begins paused if `is_paused` is set.
    """

    tool: str
    rate: float = 0.0
    is_endless: bool = False
    is_paused: bool = False
    seed: int = 1
    stall_percent: int = 0


class SimulatedRun(Run):
    """A simulation in a thread of this process, with the system's software, without a middleware."""

    def __init__(self, loaded: LoadedSystem, spec: Path, wishes: Wishes, build: Build) -> None:
        """Read the stimuli. May raise `InputError`."""
        super().__init__(loaded, spec, f"simulation in {wishes.tool}", Control())
        self.state = BUILDING
        if wishes.is_paused and self.control:
            self.control.pause()
        self._loaded, self._wishes, self._build = loaded, wishes, build
        self._description = describe(loaded)
        self._stimuli = stimuli_of(self.spec, loaded)
        self._is_over = threading.Event()
        # The node, and the timer that closes it after `stop`.
        self._running: tuple[Node, threading.Timer] | None = None
        self._thread = threading.Thread(target=self._work, name="watched run", daemon=True)

    def begin(self) -> None:
        """Build the simulator, and run it. What watches the run is there before its first cycle."""
        self._thread.start()

    def stop(self) -> None:
        """End the simulation, if it has not ended; a started build is completed."""
        if self._is_over.is_set():
            return
        self._is_over.set()
        if self.control:
            self.control.end()
        if self._running:
            node, limit = self._running
            node.stop()
            limit.start()

    def wait(self) -> None:
        """Wait until the simulation has ended."""
        self._thread.join(_END_SECONDS)

    def _work(self) -> None:
        try:
            built = self._build(self.spec, self._wishes.tool)
            self.end(self._run(built) if not self._is_over.is_set() else "")
        except (InputError, TransportError, CarrierError) as error:
            self.end(str(error).removeprefix("error: "), FAILED)

    def _run(self, built: BuiltSimulator) -> str:
        """Run the simulation to its end, and return the counts."""
        wishes, description = self._wishes, self._description
        opener = of_simulator(built, wishes.seed, wishes.stall_percent)
        # Without a rate, back-pressure limits the messages, and none is dropped.
        overflow = Overflow.DROP_OLDEST if wishes.rate else Overflow.BLOCK
        settings = NodeSettings(
            overflow=overflow, settle=_SETTLE_SECONDS, drain=_DRAIN_SECONDS, report=self._tell, watch=self.watch
        )
        with ExitStack() as stack:
            software = stack.enter_context(node_software(self._loaded, lambda error: self._tell(str(error))))
            # The messages of services and actions are played unchanged, like those of topics.
            raw = replace(description, services=(), actions=())
            node = Node(raw, checked(opener, description), settings, software)
            stack.callback(node.close)
            limit = threading.Timer(_STOP_SECONDS, node.close)
            limit.daemon = True
            # A timer that is started after its cancellation has no effect.
            stack.callback(limit.cancel)
            self._running = node, limit
            if self._is_over.is_set():
                return ""
            self.watch.restart()
            self.state = RUNNING
            assert self.control
            rounds = None if wishes.is_endless else 1
            player = Player(_numbered(self._stimuli, description), self.control, wishes.rate, rounds)
            node.run(dict.fromkeys(description.versions, player))
            self._is_over.set()
            return node.statistics.text()

    def _tell(self, report: str) -> None:
        self.text = report


def stimuli_of(spec: Path, loaded: LoadedSystem) -> list[Stimulus]:
    """Return the stimuli that the core beside a specification names. May raise `InputError`."""
    core = core_of(spec)
    name = _stimuli(core) if core else None
    if not core or not name:
        missing = f"{core.path.name} names no stimuli" if core else f"no core beside {spec.name} generates this system"
        fail(missing, hint=f"write a core: firm system core {spec.name} --stimuli stimuli.yaml")
    return system_stimuli(core.path.parent / name, loaded)


def _stimuli(core: CoreFile) -> str | None:
    name = core.parameters("simulation").get("stimuli")
    return name if isinstance(name, str) else None


def _numbered(stimuli: list[Stimulus], description: NodeDescription) -> list[tuple[int, bytes]]:
    """Return the payloads of stimuli with the numbers of their inputs."""
    numbers = {item.block: number for number, item in enumerate(description.inputs)}
    return [(numbers[item.subscriber.block], item.payload) for item in stimuli]
