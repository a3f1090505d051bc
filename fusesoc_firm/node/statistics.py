"""The counts of a node, printed when it ends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field

from fusesoc_firm.node.actions.action_end import GoalCounts
from fusesoc_firm.node.engine.calls import CallCounts
from fusesoc_firm.node.interface.description import NodeDescription


@dataclass
class Input:
    """The counts of one input of the hardware or of software; its messages come from a topic or from software."""

    received: int = 0
    dropped: int = 0
    sent: int = 0
    refused: int = 0
    """messages that the hardware rejected because of broken frames"""
    lost: int = 0
    """messages that were published, but that ROS did not deliver to the node"""


@dataclass
class Output:
    """The counts of one output of the hardware or of software; its messages go to a topic or to software."""

    frames: int = 0
    published: int = 0


@dataclass
class Statistics:
    """The counts of a run, by block; `faults` counts illegal bursts, broken frames and pulses of `id_error`."""

    inputs: dict[str, Input] = field(default_factory=dict)
    outputs: dict[str, Output] = field(default_factory=dict)
    services: Mapping[str, CallCounts] = field(default_factory=dict)
    actions: Mapping[str, GoalCounts] = field(default_factory=dict)
    faults: int = 0
    software_faults: int = 0
    restarts: int = 0
    unfinished: int = 0
    """messages in queues, and incomplete frames, when the time limit for ending expired"""

    @classmethod
    def of(
        cls,
        description: NodeDescription,
        services: Mapping[str, CallCounts] | None = None,
        actions: Mapping[str, GoalCounts] | None = None,
    ) -> Statistics:
        """Return the statistics of a node with all counts at zero, with those of its services and actions."""
        return cls(
            {item.block: Input() for item in description.inputs},
            {item.block: Output() for item in description.outputs},
            services or {},
            actions or {},
        )

    def counts(self, dropped: Mapping[str, int]) -> dict[str, int]:
        """Return all counts by their names, with the messages that the queues of inputs have `dropped` so far."""
        found: dict[str, int] = {}
        for name, item in self.inputs.items():
            found |= {f"{name} received": item.received, f"{name} dropped": item.dropped + dropped.get(name, 0)}
            found |= {f"{name} sent": item.sent, f"{name} refused": item.refused, f"{name} lost": item.lost}
        for name, output in self.outputs.items():
            found |= {f"{name} frames": output.frames, f"{name} published": output.published}
        counted: dict[str, CallCounts | GoalCounts] = {**self.services, **self.actions}
        for name, counts in counted.items():
            found |= {f"{name} {count}": value for count, value in asdict(counts).items()}
        return found | {"faults": self.faults, "faults in software": self.software_faults, "restarts": self.restarts}

    def troubles(self) -> int:
        """Return the number of dropped, lost and refused messages, of failed calls and goals, faults and restarts."""
        inputs = sum(item.dropped + item.refused + item.lost for item in self.inputs.values())
        calls = sum(item.failed + item.unasked for item in self.services.values())
        goals = sum(item.aborted + item.rejected + item.unasked + item.lost for item in self.actions.values())
        return inputs + calls + goals + self.faults + self.software_faults + self.restarts

    def text(self) -> str:
        """Return the counts as a table for the user."""
        rows: list[tuple[str, ...]] = [("from", "received", "dropped", "sent", "refused", "lost")]
        rows += [
            (name, *map(str, (item.received, item.dropped, item.sent, item.refused, item.lost)))
            for name, item in self.inputs.items()
        ]
        rows.append(("to", "frames", "published", "", "", ""))
        rows += [(name, str(item.frames), str(item.published), "", "", "") for name, item in self.outputs.items()]
        if self.services:
            rows.append(("service", "called", "answered", "failed", "unasked", ""))
        rows += [
            (name, *map(str, (item.called, item.answered, item.failed, item.unasked)), "")
            for name, item in self.services.items()
        ]
        if self.actions:
            rows.append(("action", "goals", "succeeded", "canceled", "aborted", "rejected"))
        rows += [
            (name, *map(str, (item.goals, item.succeeded, item.canceled, item.aborted, item.rejected)))
            for name, item in self.actions.items()
        ]
        notes = {
            "feedback and results for no goal": sum(item.unasked for item in self.actions.values()),
            "lost goals": sum(item.lost for item in self.actions.values()),
            "faults on the route from the hardware": self.faults,
            "faults in software": self.software_faults,
            "restarts": self.restarts,
            "messages unfinished at the end": self.unfinished,
        }
        return "\n".join([*_aligned(rows), *(f"{text}: {count}" for text, count in notes.items() if count)])


def _aligned(rows: Iterable[tuple[str, ...]]) -> list[str]:
    found = [*rows]
    widths = [max(len(row[column]) for row in found) for column in range(len(found[0]))]
    return [
        "  ".join(
            [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        ).rstrip()
        for row in found
    ]
