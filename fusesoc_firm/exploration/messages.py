"""The messages with which an exploration compares numbers: stimuli of a project, or a recorded bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.exploration.accuracy import Call, calls_of
from fusesoc_firm.runs.bags.routes import renamed
from fusesoc_firm.runs.simulation.software_run import stimulated
from fusesoc_firm.runs.simulation.stimuli import Stimulus, read_stimuli
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.message_sources import core_of
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import shown

_MOST_MESSAGES = 10_000
_SIMULATION = "simulation"


@dataclass(frozen=True)
class Messages:
    """A file with messages, or None for the stimuli of the core beside the specification; the topic of a bag, if given.

    At most 10,000 messages of a bag are read.
    """

    file: Path | None = None
    topic: str = ""

    def calls(self, spec: Path, loaded: LoadedSystem, type_: AcceleratorType) -> tuple[list[list[Call]], str]:
        """Return the calls of each block of an accelerator, and the name of the file, or why there are no calls.

        May raise `InputError`.
        """
        file = self.file or _stimuli_file(spec)
        if file is None:
            return [], "there are no stimuli"
        found = calls_of(loaded.system, type_, loaded.folder, self._stimuli(file, loaded, type_))
        if not any(found):
            return [], f"no message of {shown(file)} reaches '{type_.accelerator.name}'"
        return found, shown(file)

    def _stimuli(self, file: Path, loaded: LoadedSystem, type_: AcceleratorType) -> list[Stimulus]:
        system = loaded.system
        topics = stimulated(system)
        if self.topic:
            blocks = {item.block for item in system.accelerators if item.type.own == type_}
            fed = {item.source.block for item in system.connections if blocks & {end.block for end in item.sinks}}
            topics = [item for item in topics if item.block in fed]
            if len(topics) != 1:
                names = ", ".join(item.block for item in topics) or "none"
                fail(f"--topic needs an accelerator with one subscriber; '{type_.accelerator.name}' has {names}")
            topics = renamed(topics, {topics[0].block: self.topic})
        return read_stimuli(file, topics, system, loaded.libraries, _MOST_MESSAGES)


def _stimuli_file(spec: Path) -> Path | None:
    """Return the stimuli of the core beside a specification, if it has any."""
    core = core_of(spec)
    name = core.parameters(_SIMULATION).get("stimuli") if core else None
    file = core.path.parent / str(name) if core and name else None
    return file if file and file.exists() else None
