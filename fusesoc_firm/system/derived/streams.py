"""Messages of variable size that meet others: their streams must not wait for two turns at the same time."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from fusesoc_firm.system.derived.length import blocks_behind
from fusesoc_firm.system.derived.model import Connection
from fusesoc_firm.system.written.specification import Block
from fusesoc_firm.text.diagnostics import Diagnostics


def check_streams(
    connections: Sequence[Connection], merges: Collection[str], blocks: Mapping[str, Block], faults: Diagnostics
) -> None:
    """Note each message of variable size that has several ways to `merges`.

    A fork passes a beat when all sinks have taken it. If two of them wait for a turn, two messages may each have one of
    the turns and wait for the other one.
    """
    for connection in connections:
        if connection.length is None or len(connection.sinks) < 2:
            continue
        ways = [end for end in connection.sinks if not blocks_behind([end], connections).isdisjoint(merges)]
        if len(ways) > 1:
            source = connection.source.block
            place = blocks[source].name.source
            message = f"{connection.frame.message} from '{source}' meets other messages on {len(ways)} ways"
            hint = "its strings and arrays would wait for two turns; add 'deliver: host' to all but one publisher"
            faults.error(message, place, f"{hint}, or connect '{source}' to one block")
