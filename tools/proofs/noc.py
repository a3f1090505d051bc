"""The proofs of the routers of exchanges: each set of turns that the topologies use, with up to five ports."""

from __future__ import annotations

from fusesoc_firm.noc import network as noc
from fusesoc_firm.noc.network import Flow, Network, Topology
from tools.proofs.proof import Mutation, Proof, Size

_ROUTER = "firm_noc_router.vhd"
_BUFFER = "firm_noc_buffer.vhd"
_NEXT = "for turn in INPUTS-1 downto 1 loop"
_RENEW = "when offered = '1' else not busy_r"
# The proof of a router with more turns takes minutes.
_FEW_TURNS = 8


def _all_to_all(endpoints: int) -> tuple[Flow, ...]:
    numbers = range(endpoints)
    return tuple(Flow(source, (sink,)) for source in numbers for sink in numbers if source != sink)


def _size(made: Network, router: int, depth: int = 2) -> Size:
    """Return the turns of a router as the generics of `noc_router_case`."""
    ports = len(made.ports[router])
    return {"PORTS": ports, "TURNS": _number(made.turns[router], ports), "COPIES": 0, "DEPTH": depth}


def _number(turns: frozenset[tuple[int, int]], ports: int) -> int:
    return sum(1 << (source * ports + sink) for source, sink in turns)


def _sizes(*topologies: Topology) -> tuple[Size, ...]:
    """Return each set of turns of routers once, for flows from each endpoint to each other one."""
    made = [Network(topology, topology.slots, _all_to_all(len(topology.slots))) for topology in topologies]
    sizes = [_size(network, router) for network in made for router in range(network.topology.routers)]
    return tuple({tuple(size.items()): size for size in sizes}.values())


def _is_long(size: Size) -> bool:
    return int(size["TURNS"]).bit_count() > _FEW_TURNS


_COPIED = frozenset({(0, 1), (0, 2), (1, 0), (1, 2)})
_WITH_COPIES: Size = {
    "PORTS": 3,
    "TURNS": _number(frozenset({(0, 1), (1, 0), (2, 0), (2, 1), (1, 2)}), 3),
    "COPIES": _number(_COPIED, 3),
    "DEPTH": 2,
}
_IN_MEMORY = _size(Network(noc.chain(2), (0, 1), _all_to_all(2)), 0, depth=4)


_USED = _sizes(noc.mesh(3, 3), noc.chain(3), noc.crossbar(4), noc.tree(9))
_CORNER = 2
PROOFS = (
    Proof(
        "noc_router",
        "noc_router_case",
        ("axis/package", "noc/noc"),
        sizes=(_WITH_COPIES, _IN_MEMORY, *(size for size in _USED if not _is_long(size))),
        long_sizes=tuple(filter(_is_long, _USED)),
        depth=6,
        mutations=(
            Mutation(
                _ROUTER, "(m_ready(output) and word(0)) when offered", "word(0) when offered", ("offered_beat_stays",)
            ),
            Mutation(_ROUTER, _RENEW, "when offered = '1' else '1'", ("frames_never_mix",)),
            Mutation(_ROUTER, _RENEW, "when offered = '1' else '0'", ("idle_for_one_cycle",)),
            Mutation(_ROUTER, "valid and not first(1+DEST_BITS)", "valid", ("turn_is_legal",), _CORNER),
            Mutation(_ROUTER, _NEXT, "for turn in 0 downto 1 loop", ("after_at_most_all_others",), _CORNER),
            Mutation(_ROUTER, "left <= wanted and not done_r;", "left <= wanted;", ("in_order_unchanged",)),
            Mutation(_ROUTER, "else begins_r;", "else '0';", ("copies_ascend",)),
            Mutation(
                _BUFFER, "is_newer_r <= is_free;", "is_newer_r <= '1';", ("in_order_unchanged", "offered_beat_stays")
            ),
        ),
        sources=("noc_router_case.vhd",),
        finds_invariant=True,
    ),
)
