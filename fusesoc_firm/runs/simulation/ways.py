"""The ways of messages that meet in a merge: their order at a publisher is known only for each way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from fusesoc_firm.accelerator.software import way_to
from fusesoc_firm.runs.simulation.reference import Response
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import DerivedSystem

# The most ways that the simulated host tells apart.
MOST_WAYS = 63


def ways_of(responses: Sequence[Response], stimuli: Sequence[Stimulus], system: DerivedSystem) -> list[int]:
    """Return the way of each response, from 1, or 0 for responses of a publisher behind which no messages meet.

    The messages of one subscriber may take several ways, so its first response to a message, its second one and so on
    have different ways. Beyond the most ways, responses share ways that are used before, and thereby an order.
    """
    merges = {junction.block for junction in system.junctions if junction.sources > 1}
    if not merges:
        return [0] * len(responses)
    merged = {item.block for item in system.publishers if merges & way_to(item.block, system)}
    numbers: Counter[tuple[str, int | None]] = Counter()
    known: dict[tuple[str, str, int], int] = {}
    found = []
    for response in responses:
        publisher = response.publisher.block
        if publisher not in merged:
            found.append(0)
            continue
        place = numbers[publisher, response.cause]
        numbers[publisher, response.cause] += 1
        source = "" if response.cause is None else stimuli[response.cause].subscriber.block
        of_publisher = sum(name == publisher for name, _, _ in known)
        found.append(known.setdefault((publisher, source, place), of_publisher % MOST_WAYS + 1))
    return found
