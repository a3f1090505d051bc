"""The proofs of memories: no read meets a write of its address, so synthesis adds no logic for such a cycle."""

from __future__ import annotations

from tools.proofs.proof import Mutation, Proof, Size

_AXIS = ("axis/package", "axis/axis")


def _proof(
    entity: str,
    cores: tuple[str, ...],
    sizes: tuple[Size, ...],
    depth: int,
    fault: tuple[str, str],
    *,
    is_bounded: bool = False,
) -> Proof:
    """A proof of `collisions`; the fault is a text in the entity's file and its replacement."""
    return Proof(
        "collisions",
        entity,
        cores,
        sizes,
        depth,
        (Mutation(f"{entity}.vhd", *fault, ("no_collision",)),),
        helpers=entity,
        is_bounded=is_bounded,
    )


_TALLY = "firm_status_tally.vhd"
_TALLIED = Proof(
    "tally",
    "firm_status_tally",
    (*_AXIS, "sched/package", "status/status"),
    sizes=tuple(
        {"INDEX_BITS": 1, "COUNT_BITS": 2, "LONGEST_BITS": 1, "SHARED_READ": shared} for shared in (False, True)
    ),
    depth=12,
    mutations=(
        Mutation(_TALLY, "hit_r <= valid_r;", "hit_r <= '0';", ("counts_all", "keeps_the_longest")),
        Mutation(_TALLY, "was_valid_r <= valid_r;", "was_valid_r <= '0';", ("counts_all",), 1),
    ),
    is_bounded=True,
)

PROOFS = (
    _TALLIED,
    _proof(
        "firm_axis_fifo",
        _AXIS,
        tuple({"WIDTH": 8, "DEPTH": depth} for depth in (2, 3, 4, 16)),
        2,
        ("ready_r  <= not fills;", "ready_r  <= '1';"),
    ),
    _proof(
        "firm_axis_length_buffer",
        _AXIS,
        tuple({"WIDTH": 64, "DEPTH": depth} for depth in (2, 4)),
        12,
        ("if level = DEPTH then", "if level = DEPTH+1 then"),
        is_bounded=True,
    ),
    _proof(
        "firm_axis_queue",
        _AXIS,
        (
            {"WIDTH": 8, "FRAMES": 2, "BEATS": 2, "DROP_OLDEST": True},
            {"WIDTH": 8, "FRAMES": 2, "BEATS": 2, "DROP_NEWEST": True},
            {"WIDTH": 8, "FRAMES": 2, "BEATS": 2},
            {"WIDTH": 8, "FRAMES": 1, "BEATS": 4, "DROP_NEWEST": True},
        ),
        16,
        ("free(free_end_r) <= leaving_r;", "free(free_end_r) <= oldest;"),
        is_bounded=True,
    ),
    _proof(
        "firm_cobs_encoder",
        (*_AXIS, "cdc/sync", "board/link"),
        ({"DEPTH": 512},),
        2,
        ("filled <= '0' when read_r = code_place_r else", "filled <= '0' when read_r = code_place_r - 1 else"),
    ),
    _proof(
        "firm_link_store",
        (*_AXIS, "cdc/sync", "board/link"),
        ({"LONGEST": 2, "SPARE": 1}, {"LONGEST": 50, "SPARE": 1}),
        2,
        ("'1' when read_r /= start_r and", "'1' when read_r /= start_r + 1 and"),
    ),
    _proof(
        "firm_mac_store",
        (*_AXIS, "net/mac"),
        ({"DEPTH": 4}, {"DEPTH": 64}),
        2,
        ("'1' when read_r /= start_r and", "'1' when read_r /= start_r + 1 and"),
    ),
    _proof(
        "firm_wiznet_fifo",
        (*_AXIS, "cdc/sync", "net/streams", "net/wiznet", "net/wiznet_node"),
        ({},),
        2,
        ("'1' when level_r /= 0 and", "'1' when level_r /= 1 and"),
    ),
    _proof(
        "firm_packet_builder",
        ("net/builder",),
        ({"ADDRESS_BITS": 4, "BANK_BITS": 1},),
        2,
        ("if moves = '1' then\n        field_r", "if advance = '1' then\n        field_r"),
    ),
)
