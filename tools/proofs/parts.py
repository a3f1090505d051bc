"""The proofs of parts: queue, watchdog, the tree of Managers with and without one, and the store of Ethernet frames."""

from __future__ import annotations

from tools.bench.designs import SUBSCRIBER, Converter
from tools.proofs.proof import Mutation, Proof, Size

_QUEUE = "firm_axis_queue.vhd"
_WATCHDOG = "firm_axis_watchdog.vhd"
_SUBSCRIBER = "axis_to_std_msgs_string"
_SINK_WATCHDOG = "firm_axis_sink_watchdog.vhd"
_GROUP = "firm_manager_group.vhd"
_TREE = "firm_manager_tree.vhd"
_INSERT = "firm_axis_id_insert.vhd"


def _queue_size(frames: int, overflow: str) -> Size:
    return {
        "WIDTH": 8,
        "FRAMES": frames,
        "BEATS": 2,
        "DROP_OLDEST": overflow == "drop_oldest",
        "DROP_NEWEST": overflow == "drop_newest",
    }


_OLDEST, _NEWEST, _BLOCK = range(3)

_QUEUED = Proof(
    "queue",
    "firm_axis_queue",
    ("axis/package", "axis/axis"),
    sizes=(
        _queue_size(2, "drop_oldest"),
        _queue_size(2, "drop_newest"),
        _queue_size(2, "block"),
        _queue_size(1, "drop_newest"),
    ),
    depth=11,
    mutations=(
        Mutation(_QUEUE, "read_beat or (valid_r and not m_axis_tready)", "read_beat", ("valid_stays",)),
        Mutation(_QUEUE, "(not between and m_axis_tready)", "not between", ("payload_stays",)),
        Mutation(
            _QUEUE,
            "(skipping_r or arrived or refuse) and",
            "(skipping_r or arrived) and",
            ("frames_are_whole",),
            _NEWEST,
        ),
        Mutation(_QUEUE, "free(free_end_r) <= leaving_r;", "free(free_end_r) <= oldest;", ("frames_in_order",), _BLOCK),
        Mutation(
            _QUEUE, "memory(write) <= is_end & s_axis_tuser", 'memory(write) <= is_end & "0"', ("marks_unchanged",)
        ),
        Mutation(_QUEUE, "drop <= refuse or replace;", "drop <= refuse or arrived;", ("no_report_invented",)),
        Mutation(_QUEUE, "drop <= refuse or replace;", "drop <= refuse;", ("nothing_lost",)),
        Mutation(_QUEUE, "drop <= refuse or replace;", "drop <= arrived;", ("nothing_dropped",), _BLOCK),
    ),
    trace=12,
    is_bounded=True,
)

_MERGE = "firm_message_merge.vhd"
_TURN = "others_i /= NOTHING and (is_done = '1' or is_going = '0')"

_MERGED = Proof(
    "message_merge",
    "firm_message_merge",
    ("axis/package", "axis/axis"),
    sizes=tuple({"SOURCES": count, "FIELD_BITS": 2, "OFFERS": 2, "TAKES": 2} for count in (2, 3, 4)),
    depth=14,
    mutations=(
        Mutation(
            _MERGE,
            "(words(bits*source + place) and turn(source))",
            "words(bits*source + place)",
            ("comes_from_its_source",),
        ),
        Mutation(
            _MERGE,
            "sink_takes(place) and turn_r(source)",
            "sink_takes(0) and turn_r(source)",
            ("taken_as_the_sink_takes",),
        ),
        Mutation(_MERGE, "sink_takes(place) and turn_r(source)", "sink_takes(place)", ("takes_reach_only_it",)),
        Mutation(_MERGE, _TURN, "others_i /= NOTHING", ("source_stays",)),
        Mutation(_MERGE, _TURN, "others_i /= NOTHING and is_done = '1'", ("idle_for_one_cycle",)),
        Mutation(_MERGE, _TURN, "others_i /= NOTHING and is_going = '0'", ("no_gap",)),
        Mutation(
            _MERGE,
            "shift_left(resize(unsigned(turn_r), 2*SOURCES), 1)",
            "to_unsigned(1, 2*SOURCES)",
            ("after_at_most_all_others",),
            1,
        ),
    ),
    trace=12,
    is_bounded=True,
)

_SEND = "firm_message_send.vhd"
_SENT_MESSAGES = Proof(
    "message_send",
    "firm_message_send",
    ("axis/package", "axis/axis"),
    sizes=tuple(
        {"WIDTH": 8, "FIELD_BITS": bits, "COPIES": copies}
        for bits, copies in ((20, 2), (20, 1), (5, 3), (8, 1), (40, 3))
    ),
    depth=3,
    mutations=(
        Mutation(_SEND, "advances <= not valid_r or m_axis_tready;", "advances <= '1';", ("beat_stays",)),
        Mutation(_SEND, "loads    <= not valid_r or ends_r;", "loads <= not valid_r or last_r;", ("copies_in_order",)),
        Mutation(_SEND, "ready         <= advances and loads;", "ready <= loads;", ("takes_the_next_at_its_end",)),
        Mutation(
            _SEND,
            "message_r(LANES-1 downto 0) & message_r(BITS-1 downto LANES)",
            "message_r(BITS-LANES-1 downto 0) & message_r(BITS-1 downto BITS-LANES)",
            ("beats_in_order",),
        ),
        Mutation(_SEND, "FIELD_BITS) <= (others => '0');", "FIELD_BITS) <= (others => '1');", ("beats_in_order",)),
        Mutation(_SEND, "last_r     <= bit_of(position_r = max(0, BEATS-2));", "last_r <= '0';", ("last_is_marked",)),
        Mutation(_SEND, "valid_r    <= valid;", "valid_r <= valid and not ends_r;", ("offered_without_a_gap",)),
    ),
)

_RECEIVE = "firm_message_receive.vhd"
_RECEIVED_MESSAGES = Proof(
    "message_receive",
    "firm_message_receive",
    ("axis/package", "axis/axis"),
    sizes=tuple({"WIDTH": 8, "FIELD_BITS": bits} for bits in (20, 5, 8, 40)),
    depth=3,
    mutations=(
        Mutation(_RECEIVE, "has_room      <= ready or not valid_r;", "has_room <= '1';", ("message_stays",)),
        Mutation(
            _RECEIVE,
            "valid_r <= s_axis_tvalid and s_axis_tlast;",
            "valid_r <= s_axis_tvalid;",
            ("offered_when_complete",),
        ),
        Mutation(_RECEIVE, "s_axis_tready <= has_room;", "s_axis_tready <= not valid_r;", ("room_when_taken",)),
        Mutation(_RECEIVE, "if s_axis_tvalid = '1' then", "if s_axis_tlast = '1' then", ("fields_are_those_sent",)),
        Mutation(_RECEIVE, "s_axis_tdata & message_r;", "message_r & s_axis_tdata;", ("fields_are_those_sent",)),
    ),
)

_MESSAGES = "firm_message_queue.vhd"


def _messages_size(messages: int, overflow: str) -> Size:
    drops = {"DROP_OLDEST": overflow == "drop_oldest", "DROP_NEWEST": overflow == "drop_newest"}
    return {"FIELD_BITS": 5, "MESSAGES": messages, **drops}


_QUEUED_MESSAGES = Proof(
    "message_queue",
    "firm_message_queue",
    ("axis/package", "axis/axis"),
    sizes=(
        _messages_size(3, "drop_oldest"),
        _messages_size(3, "drop_newest"),
        _messages_size(3, "block"),
        _messages_size(1, "block"),
    ),
    depth=14,
    mutations=(
        Mutation(_MESSAGES, "may_load <= sink_ready or not valid_r;", "may_load <= '1';", ("valid_stays",)),
        Mutation(_MESSAGES, "elsif may_load = '1' then", "else", ("payload_stays",)),
        Mutation(_MESSAGES, "valid_r <= is_stored or enters;", "valid_r <= is_stored;", ("offered_if_held",)),
        Mutation(_MESSAGES, "'1' when DROPS else not is_full;", "'1';", ("ready_if_room",), 2),
        Mutation(
            _MESSAGES,
            "writes   <= enters and not (may_load and not is_stored);",
            "writes   <= enters;",
            ("in_order_once",),
        ),
        Mutation(
            _MESSAGES,
            "if reads = '1' or drops_i = '1' then",
            "if reads = '1' then",
            ("in_order_once",),
        ),
        Mutation(
            _MESSAGES,
            "fields_r <= memory(read_index_r);",
            "fields_r <= memory(write_index_r);",
            ("nothing_dropped",),
            2,
        ),
    ),
    trace=12,
    is_bounded=True,
)

_WATCHED = Proof(
    "watchdog",
    "firm_axis_watchdog",
    ("axis/package", "axis/axis"),
    sizes=({"WIDTH": 8, "SOURCES": 2, "LIMIT": 2}, {"WIDTH": 8, "SOURCES": 4, "LIMIT": 3}),
    depth=16,
    mutations=(
        Mutation(_WATCHDOG, "cut_r    <= '1';", "cut_r    <= '0';", ("frees_the_channel",)),
        Mutation(
            _WATCHDOG,
            "inside_r <= not s_axis_tlast;",
            "inside_r <= not s_axis_tlast and not late;",
            ("frees_the_grant",),
        ),
        Mutation(_WATCHDOG, "m_axis_tlast    <= '1';", "m_axis_tlast    <= '0';", ("abort_ends_one_frame",)),
        Mutation(_WATCHDOG, "not clears and not late and", "not clears and", ("no_late_beat_leaves",)),
        Mutation(_WATCHDOG, "inside_r = '1' and ready = '1'", "inside_r = '1'", ("no_hasty_abort",)),
        Mutation(_WATCHDOG, "m_axis_tlast <= s_axis_tlast;", "m_axis_tlast <= '1';", ("beats_pass_unchanged",)),
        Mutation(_WATCHDOG, "rst_n and ends and not late", "rst_n and ends", ("each_abort_is_reported",)),
    ),
    trace=16,
    is_bounded=True,
)

_WATCHED_SINK = Proof(
    "sink_watchdog",
    "firm_axis_sink_watchdog",
    ("axis/package", "axis/axis"),
    sizes=({"WIDTH": 8, "LIMIT": 2}, {"WIDTH": 8, "LIMIT": 3}),
    depth=11,
    mutations=(
        Mutation(_SINK_WATCHDOG, "free    <= m_axis_tready or not valid_r;", "free    <= '1';", ("valid_stays",)),
        Mutation(
            _SINK_WATCHDOG,
            "      if free = '1' then\n        if stuck_r",
            "      if ready = '1' then\n        if stuck_r",
            ("payload_stays",),
        ),
        Mutation(
            _SINK_WATCHDOG,
            "dropping_r <= '1';",
            "dropping_r <= '0';",
            ("frees_the_channel",),
        ),
        Mutation(_SINK_WATCHDOG, "waited_r = LIMIT-1", "waited_r = 0", ("no_hasty_report",)),
        Mutation(_SINK_WATCHDOG, "(stuck_r and is_open) or", "", ("frames_are_whole",)),
        Mutation(_SINK_WATCHDOG, "tlast_r <= s_axis_tlast;", "tlast_r <= '0';", ("frames_in_order",)),
        Mutation(_SINK_WATCHDOG, "(stuck_r and is_open) or", "stuck_r or", ("abort_ends_one_frame",)),
        Mutation(
            _SINK_WATCHDOG,
            "lost <= expires or (s_axis_tvalid and refuse);",
            "lost <= expires or drop;",
            ("no_report_invented",),
        ),
        Mutation(
            _SINK_WATCHDOG, "lost <= expires or (s_axis_tvalid and refuse);", "lost <= expires;", ("nothing_lost",)
        ),
        Mutation(
            _SINK_WATCHDOG, "lost <= expires or (s_axis_tvalid and refuse);", "lost <= '0';", ("aborts_are_reported",)
        ),
    ),
    trace=12,
    is_bounded=True,
)

_REFUSED = Proof(
    "refused_frames",
    _SUBSCRIBER,
    ("axis/package", "axis/axis"),
    sizes=({"MAX_LENGTH": 6},),
    depth=17,
    mutations=(
        Mutation(
            f"{_SUBSCRIBER}.vhd",
            "is_refused <= check_r and not",
            "is_refused <= '0' and not",
            ("no_refused_byte_leaves", "no_refused_message"),
        ),
        Mutation(
            f"{_SUBSCRIBER}.vhd",
            "length_t'range), MAX_LENGTH+1)",
            "length_t'range), MAX_LENGTH)",
            ("no_report_invented",),
        ),
        Mutation(f"{_SUBSCRIBER}.vhd", "frame_fault <= TOO_LONG;", "frame_fault <= BAD_LENGTH;", ("each_is_reported",)),
    ),
    trace=18,
    is_bounded=True,
    converter=Converter(1, "std_msgs/String", SUBSCRIBER, 8),
)

_TREE_CORES = (
    "axis/package",
    "axis/axis",
    "sched/package",
    *(f"sched/{core}" for core in ("queue", "engine", "fixed_priority", "round_robin", "lru")),
    *(f"sched/{core}" for core in ("edf_resources", "edf_latency", "lst", "by_policy")),
    "manager/manager",
    "manager/tree",
)

# The upper byte of an id gets lost before the host, or beside its frame.
_WITHOUT_HIGHS = (
    Mutation(_TREE, "high          => granted_high,", 'high          => x"00",', ("upper_byte_is_inserted",)),
    Mutation(_TREE, "sent_tuser(8 downto 1) <= granted_high;", 'sent_tuser(8 downto 1) <= x"00";', ("tid_is_the_id",)),
)
_TREE_TO_HOST = Proof(
    "manager_tree",
    "small_tree",
    _TREE_CORES,
    sizes=({"PUBLISHERS": 4}, {"PUBLISHERS": 2}),
    depth=10,
    mutations=(
        Mutation(
            "firm_axis_register_slice.vhd",
            "move      <= m_axis_tready or not valid_r",
            "move      <= '1'",
            ("valid_stays", "payload_stays", "all_comes_out"),
        ),
        Mutation(
            "firm_axis_mux.vhd", "<= decode(source, take, SOURCES)", "<= (others => take)", ("one_grant_in_a_group",)
        ),
        Mutation(
            _INSERT,
            "when extra_r = '1' else s_axis_tdata;",
            "when extra_r = '1' else not s_axis_tdata;",
            ("begins_with_its_id",),
        ),
        *_WITHOUT_HIGHS,
        Mutation(
            "firm_axis_register_slice.vhd",
            "<= skid_r when skidded = '1' else arriving",
            "<= arriving",
            ("in_order_without_loss",),
        ),
        Mutation(
            _TREE,
            "m_axis_tuser            <= out_tuser(0 downto 0);",
            "m_axis_tuser            <= not out_tuser(0 downto 0);",
            ("abort_ends_a_frame",),
        ),
    ),
    sources=("small_tree.vhd",),
    trace=12,
    is_bounded=True,
)

_REPORT = "pub_ready;"
_WATCHED_TREE = Proof(
    "tree_watchdog",
    "small_tree",
    _TREE_CORES,
    sizes=({"PUBLISHERS": 3, "WATCHDOG": 2}, {"PUBLISHERS": 2, "WATCHDOG": 4}),
    depth=12,
    mutations=(
        Mutation(_WATCHDOG, "not clears and not late and", "not clears and", ("begins_with_its_id",)),
        Mutation(_WATCHDOG, "m_axis_tlast    <= '1';", "m_axis_tlast    <= '0';", ("abort_ends_one_frame",)),
        Mutation(_WATCHDOG, 'm_axis_tuser    <= "1";', 'm_axis_tuser    <= "0";', ("whole_without_abort",)),
        *_WITHOUT_HIGHS,
        Mutation(
            _TREE, "tick     <= '1' when counted_r = PERIOD-1 else '0';", "tick     <= '1';", ("no_hasty_abort",), 1
        ),
        Mutation(_WATCHDOG, "inside_r = '1' and ready = '1'", "inside_r = '1'", ("no_hasty_abort",)),
        Mutation(_GROUP, f"expired <= {_REPORT}", f"expired <= not {_REPORT}", ("each_abort_is_reported",)),
        Mutation(_GROUP, f"expired <= {_REPORT}", "expired <= (others => '1');", ("no_report_invented",)),
    ),
    sources=("small_tree.vhd",),
    trace=12,
    is_bounded=True,
)

_WATCHED_TREE_LIMITS = Proof(
    "tree_watchdog_limits",
    "small_tree",
    _TREE_CORES,
    sizes=({"PUBLISHERS": 3, "WATCHDOG": 2}, {"PUBLISHERS": 3, "WATCHDOG": 4}),
    depth=23,
    mutations=(
        Mutation(_GROUP, "sched_last    <= cut or granted", "sched_last    <= granted", ("frees_the_group",), 1),
        Mutation(_WATCHDOG, "cut_r    <= '1';", "cut_r    <= '0';", ("frees_the_channel",), 1),
    ),
    sources=("small_tree.vhd",),
    trace=23,
    is_bounded=True,
)

_STORE = "firm_mac_store.vhd"

_STORED = Proof(
    "frame_store",
    "firm_mac_store",
    ("axis/package", "axis/axis", "net/mac"),
    sizes=({"DEPTH": 4},),
    depth=11,
    mutations=(
        Mutation(_STORE, "fetch or (valid_r and not m_axis_tready)", "fetch", ("valid_stays",)),
        Mutation(_STORE, "(m_axis_tready = '1' or valid_r = '0')", "true", ("payload_stays",)),
        Mutation(
            _STORE,
            "commit   <= ends and has_room and not s_axis_tuser(0)",
            "commit   <= ends and has_room",
            ("no_byte_of_a_bad_frame",),
        ),
        Mutation(_STORE, "else not full_r;", "else '1';", ("in_order_once",)),
        Mutation(_STORE, "<= s_axis_tlast & s_axis_tdata;", "<= '1' & s_axis_tdata;", ("whole_frames",)),
        Mutation(_STORE, "is_lost <= ends and not has_room", "is_lost <= '0' and not has_room", ("lost_or_delivered",)),
        Mutation(_STORE, "read_r /= start_r", "read_r /= write_r", ("no_pause",)),
    ),
    trace=12,
    is_bounded=True,
)

_RECEIVER = "firm_mac_receiver.vhd"

_RECEIVED = Proof(
    "frame_receiver",
    "firm_mac_receiver",
    ("axis/package", "axis/axis", "net/mac"),
    sizes=({"LONGEST": 60}, {"LONGEST": 1514}),
    depth=3,
    mutations=(
        # A trace with a good frame has 64 bytes, for which a search takes too long.
        Mutation(_RECEIVER, "is_below(count, SHORTEST)", "is_below(count, FCS_BYTES+1)", ("good_if_right",)),
        Mutation(_RECEIVER, "(ends and not is_whole) or overflows", "overflows", ("good_if_right",)),
        Mutation(_RECEIVER, "(takes_byte or ends) and has_byte", "takes_byte and has_byte", ("begun_frames_end",)),
        Mutation(_RECEIVER, "m_axis_tlast    <= ends or overflows;", "m_axis_tlast    <= takes_byte;", ("one_end",)),
        Mutation(
            _RECEIVER, "m_axis_tdata    <= delay_r(FCS_BYTES)", "m_axis_tdata    <= delay_r(0)", ("bytes_unchanged",)
        ),
        Mutation(_RECEIVER, "is_broken <= ends and not is_whole;", "is_broken <= '0';", ("one_verdict",)),
        Mutation(_RECEIVER, "is_good   <= ends and is_whole;", "is_good   <= ends;", ("no_second_verdict",)),
    ),
    trace=14,
)

_WALKER = "firm_rtps_walker.vhd"

_WALKED = Proof(
    "packet_walker",
    "firm_rtps_walker",
    ("axis/package", "axis/axis", "net/mac", "net/rtps"),
    sizes=({},),
    depth=3,
    mutations=(
        # A trace with a submessage has 36 bytes or more, for which a search takes too long.
        Mutation(_WALKER, "is_foreign <= strange and not abort_r;", "is_foreign <= strange;", ("one_verdict",)),
        Mutation(_WALKER, "is_aborted <= abort_r;", "is_aborted <= '0';", ("aborts_are_told",)),
        Mutation(_WALKER, "<= written and valid_r and rst_n;", "<= written and rst_n;", ("nothing_between",)),
        Mutation(_WALKER, "if step_r(PAYLOAD) = '1' then", "if step_r(PROTOCOL) = '1' then", ("only_of_rtps_2",)),
        Mutation(
            _WALKER,
            "if in_body = '1' then\n        is_submessage <= valid_r and ends_body and is_done and known_r",
            "if in_body = '0' then\n        is_submessage <= valid_r and last_r",
            ("submessages_end_in_time",),
        ),
    ),
    trace=14,
)

_READERS = "firm_rtps_readers.vhd"
_RTPS_CORES = ("axis/package", "axis/axis", "net/mac", "net/rtps")
_READER_SIZE: Size = {"READERS": 1, "SOURCES": 2, "BYTES": 4, "SAMPLES": 2}

_TAKEN = "(equal_r or (later_r and not strict_r))"
_READ = Proof(
    "reader",
    "firm_rtps_readers",
    _RTPS_CORES,
    sizes=(_READER_SIZE,),
    depth=3,
    mutations=(
        Mutation(_READERS, _TAKEN, "(equal_r or later_r)", ("no_gap_if_reliable",)),
        Mutation(_READERS, _TAKEN, "(equal_r or not strict_r)", ("once_and_in_order",)),
        Mutation(_READERS, f"same_r and {_TAKEN}", _TAKEN, ("only_of_the_writer_that_sent",)),
        Mutation(_READERS, _TAKEN, "(later_r and not strict_r)", ("nothing_refused_that_is_next",)),
        Mutation(_READERS, "is_locked = '0' and queued_r = '1'", "queued_r = '1'", ("nothing_judged_under_lock",)),
        Mutation(_READERS, "chosen when is_locked = '1' else from;", "from;", ("window_is_shown",)),
        Mutation(_READERS, "if judged_r = first_r then", "if judged_r = last_r then", ("each_once",)),
        Mutation(
            _READERS, "  first_r <= last;\n      end if;", "end if;\n      first_r <= last;", ("one_commit_a_packet",)
        ),
        Mutation(_READERS, "        first_r <= last;", "        first_r <= first_r;", ("all_of_a_good_packet",)),
        Mutation(_READERS, "          last  := first_r;", "          null;", ("nothing_of_a_bad_packet",)),
        Mutation(
            _READERS, "<= keeps_r when state_r /= IDLE", "<= '1' when state_r /= IDLE", ("only_taken_ones_leave",)
        ),
        Mutation(
            _READERS,
            "if left_r = 1 then\n          finish;",
            "if left_r = 2 then\n          finish;",
            ("each_leaves_once",),
        ),
    ),
    trace=18,
)

PROOFS = (
    _QUEUED,
    _MERGED,
    _SENT_MESSAGES,
    _RECEIVED_MESSAGES,
    _QUEUED_MESSAGES,
    _WATCHED,
    _WATCHED_SINK,
    _REFUSED,
    _TREE_TO_HOST,
    _WATCHED_TREE,
    _WATCHED_TREE_LIMITS,
    _STORED,
    _RECEIVED,
    _WALKED,
    _READ,
)
