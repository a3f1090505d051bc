"""The cells and cycles of messages' ways: LUT4 of an ECP5, from measurements of many sizes (docs/figures/noc.md)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from itertools import pairwise

from fusesoc_firm.noc.network import Flow, Network

# LUT4 of a buffer for each bit of a beat, and of each further source of an output for each bit and beside the bits.
_BUFFER_BIT, _TURN_BIT, _TURN = 1.07, 0.70, 15.4
# LUT4 of a sender beside one for each bit of its messages, and of a source of a merge beside those for its bits.
_SENDER, _SOURCE = 15, 6


def merge_lut(sources: int, bits: int) -> int:
    """Return the estimated LUT4 of `firm_message_merge`.

    A LUT chooses among two sources, and one joins three of these choices with a fourth one.
    """
    pairs, single = divmod(sources, 2)
    return bits * (pairs + -(-(pairs + single - 1) // 3)) + _SOURCE * sources


def sender_lut(bits: int) -> int:
    """Return the estimated LUT4 of `firm_message_send`."""
    return bits + _SENDER


def router_lut(turns: Collection[tuple[int, int]], bits: int) -> int:
    """Return the estimated LUT4 of a router whose beats have so many bits, with the last mark and the destination."""
    buffers = len({source for source, _ in turns})
    further = sum(count - 1 for count in Counter(sink for _, sink in turns).values())
    return round(buffers * _BUFFER_BIT * bits + further * (_TURN + _TURN_BIT * bits))


def routers_lut(network: Network, width: int) -> int:
    """Return the estimated LUT4 of all routers for streams of `width` bits, of which all beats are full."""
    bits = width + 1 + max(1, (network.endpoints - 1).bit_length())
    return sum(router_lut(turns, bits) for turns in network.turns)


def delay(network: Network, flow: Flow, sink: int) -> int:
    """Return the most cycles of a beat through the routers to one of a flow's sinks, if nothing else is under way.

    A router takes a cycle, a further one if its output turns to another input first, and one if it copies the beat.
    """
    total = int(len(flow.sinks) > 1)
    for channel, following in pairwise(network.channels(flow.source, sink)):
        router = channel.sink.number
        output = network.ports[router].index(following.sink)
        total += 1 + (sum(sink == output for _, sink in network.turns[router]) > 1)
    return total
