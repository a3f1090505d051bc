"""Subscribers that hold the host's channel: their message waits in the converter for another one behind it."""

from __future__ import annotations

from collections.abc import Mapping

from fusesoc_firm.system.derived.model import AcceleratorBlock, DerivedSystem
from fusesoc_firm.system.written.specification import Block
from fusesoc_firm.text.diagnostics import Diagnostics


def check_held(system: DerivedSystem, blocks: Mapping[str, Block], faults: Diagnostics) -> None:
    """Warn of messages of variable size for a compiled function that needs another message of the same channel.

    The function takes its messages together, and a converter without a queue stores no message of variable size.
    """
    for item in system.accelerators:
        if item.type.own.accelerator.is_compiled:
            _check_inputs(system, item, blocks, faults)


def _check_inputs(
    system: DerivedSystem, item: AcceleratorBlock, blocks: Mapping[str, Block], faults: Diagnostics
) -> None:
    subscribers = {converter.block: converter for converter in system.subscribers}
    sources = [
        subscribers[connection.source.block]
        for connection in system.connections
        if connection.source.block in subscribers and any(sink.block == item.block for sink in connection.sinks)
    ]
    for source in sources if len(sources) > 1 else ():
        if not source.frame.is_fixed_size and source.queue is None:
            others = " and ".join(f"'{other.block}'" for other in sources if other is not source)
            message = f"'{source.block}' holds the channel until '{item.block}' has the message of {others}, too"
            hint = f"add 'queue: 2' to '{source.block}', or nothing moves if its message comes first"
            faults.warn(message, blocks[source.block].name.source, hint)
