"""The proofs of the Manager: each direction, and bursts under preemption."""

from __future__ import annotations

from tools.proofs.proof import Mutation, Proof, Size

_CORES = ("axis/package", "axis/axis", "manager/manager")
_ENTITY = "firm_manager"

_SLICE = "firm_axis_register_slice.vhd"
_DEMUX = "firm_axis_demux.vhd"
_MUX = "firm_axis_mux.vhd"
_BURST = "firm_axis_burst.vhd"
_GROUP = "firm_manager_group.vhd"


def _size(width: int, channels: int, *, is_preemptive: bool = False) -> Size:
    return {"WIDTH": width, "SUBSCRIBERS": channels, "PUBLISHERS": channels, "PREEMPTIVE": is_preemptive}


def _overwrites(*violates: str) -> Mutation:
    return Mutation(_SLICE, "move      <= m_axis_tready or not valid_r", "move      <= '1'", violates)


def _forgets_skid(*violates: str) -> Mutation:
    return Mutation(_SLICE, "<= skid_r when skidded = '1' else arriving", "<= arriving", violates)


def _halves_rate(*violates: str) -> Mutation:
    return Mutation(_SLICE, "ready_r <= '1';", "ready_r <= not available;", violates)


def _loses_id(*violates: str) -> Mutation:
    return Mutation(_SLICE, "and output_r.tlast = '1' then", "and output_r.tlast = '0' then", violates)


# What both kinds of the Manager owe the publishers and the scheduler.
_SLOT = (
    Mutation(_MUX, "<= decode(source, take, SOURCES)", "<= (others => take)", ("only_the_granted_one_is_taken",)),
    Mutation(
        _GROUP, "sched_request <= pub_axis_tvalid", "sched_request <= (others => '1')", ("scheduler_sees_requests",)
    ),
    Mutation(_GROUP, "(granted_tvalid and granted_tready)", "granted_tvalid", ("scheduler_sees_beats",)),
    Mutation(_GROUP, "cut or granted_tlast", "'1'", ("scheduler_sees_last",)),
)

_TO_SUBSCRIBERS = Proof(
    "manager_to_subscribers",
    _ENTITY,
    _CORES,
    sizes=(_size(8, 2), _size(8, 3), _size(8, 4), _size(16, 2), _size(16, 4)),
    depth=5,
    mutations=(
        _overwrites("sub_valid_stays", "sub_payload_stays", "no_beat_lost"),
        _forgets_skid("in_order_unchanged"),
        _halves_rate("no_bubble"),
        Mutation(
            _SLICE,
            "available <= skidded or (s_axis_tvalid and ready_r)",
            "available <= s_axis_tvalid and ready_r",
            ("all_comes_out",),
        ),
        Mutation(
            _DEMUX, "<= decode(index, valid, DESTINATIONS)", "<= (others => valid)", ("one_subscriber_at_a_time",)
        ),
        Mutation(
            _DEMUX,
            "forward <= known_r and not first_r",
            "forward <= not first_r",
            ("no_beat_invented", "no_refused_beat_leaves"),
        ),
        Mutation(_DEMUX, "index   <= index_r;", "index   <= not index_r;", ("routed_by_id",)),
        Mutation(
            _DEMUX, "<= s_axis_tvalid and forward;", "<= s_axis_tvalid and forward and ready(0);", ("offered_unasked",)
        ),
        Mutation(_DEMUX, "id_error <= not known_id", "id_error <= '1'", ("no_error_invented",)),
        Mutation(_DEMUX, "id_error <= not known_id", "id_error <= '0'", ("no_error_lost", "all_errors_told")),
    ),
    trace=14,
)

_TO_HOST = Proof(
    "manager_to_host",
    _ENTITY,
    _CORES,
    sizes=(_size(8, 2), _size(8, 3), _size(8, 4), _size(16, 2), _size(16, 4)),
    depth=4,
    mutations=(
        *_SLOT,
        _overwrites("m_valid_stays", "m_payload_stays", "offered_if_inside", "no_beat_lost"),
        _forgets_skid("in_order_unchanged"),
        _halves_rate("no_bubble"),
        _loses_id("tid_is_the_publisher"),
        Mutation(_GROUP, "<= granted_tuser", '<= "1"', ("abort_ends_one_frame",)),
        Mutation(_GROUP, "<= granted_tuser", '<= "0"', ("no_abort_lost",)),
    ),
)

_BURSTS = Proof(
    "manager_bursts",
    _ENTITY,
    _CORES,
    sizes=tuple(_size(width, channels, is_preemptive=True) for width in (8, 16) for channels in (2, 4)),
    depth=6,
    mutations=(
        *_SLOT,
        _overwrites("m_valid_stays", "m_payload_stays", "no_beat_lost"),
        _loses_id("tid_is_the_publisher"),
        Mutation(_BURST, "(m_axis_tready and not resume_r)", "m_axis_tready", ("in_order_unchanged",)),
        Mutation(_BURST, "(resume_r or held_tlast_r or s_axis_tvalid)", "'1'", ("sent_when_its_end_is_known",)),
        Mutation(
            _BURST, "(resume_r or held_tlast_r or s_axis_tvalid)", "(resume_r or s_axis_tvalid)", ("all_comes_out",)
        ),
        Mutation(
            _BURST,
            "and (held_tlast_r or moved)",
            "and held_tlast_r",
            ("bursts_end_with_tlast", "bursts_begin_frames", "resumption_begins_a_burst"),
        ),
        Mutation(
            _BURST,
            "resize(unsigned(held_source_r)",
            "resize(unsigned(not held_source_r)",
            ("resumption_names_the_publisher",),
        ),
        Mutation(_BURST, "held_r   <= resume_r;", "held_r   <= '1';", ("no_beat_invented",)),
        Mutation(_BURST, "cleared_r <= cleared_r + 1", "cleared_r <= cleared_r", ("no_bubble",)),
    ),
)

PROOFS = (_TO_SUBSCRIBERS, _TO_HOST, _BURSTS)
