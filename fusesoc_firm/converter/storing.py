"""The configuration of stores, for the partials `store_signals`, `store_enables`, `store_beats` and `store_resets`.

A template that includes these partials counts the beats in `position_r` from the same origin as the stores. The
template's signal `is_first` identifies beat 0, regardless of the count. The template includes `store_beats` where it
accepts a beat. Comparisons with the limits of a store's windows enable the store. If there are many windows, a table
holds the limits instead, and a pointer advances through the table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby

from fusesoc_firm.converter.slices import Slice
from fusesoc_firm.converter.stream import Store, StoreMap, ranges
from fusesoc_firm.converter.vhdl import bits, within
from fusesoc_firm.text.render import Context

# With many windows and many beats, a table takes less logic (at 8 bits: 45 LUTs plus 1.3 per window; comparisons take
# 40 plus 2.3). With few beats, the comparisons reduce to a small function of the counter.
_MOST_COMPARED = 8
_TABLE_BEATS = 1024
_NUMBERS_IN_A_ROW = 12


def is_beat(first: int, last: int) -> str:
    """The condition for the beats from `first` to `last`."""
    if first > 0:
        return within("position_r", first, last)
    return "is_first = '1'" if last == 0 else f"(is_first = '1' or position_r <= {last})"


def enables(store: Store, position: str, last_beat: int, *, is_part: bool) -> list[str]:
    """The alternative conditions on the signal `position` that enable a store; empty if every beat enables it.

    The windows' bytes shift out earlier bytes, so the first window needs no lower limit. A part of a larger store keeps
    the limit; otherwise, a simulator would copy all parts in each beat. No beat follows `last_beat`.
    """
    (first, last), *others = ranges(store.beats)
    windows = [(first if is_part else 0, last), *others]
    limits = [(first, None if last == last_beat else last) for first, last in windows]
    return [] if (0, None) in limits else [within(position, *each) for each in limits]


def _is_used(table: int, store: Store, parts: Sequence[Store]) -> str:
    """The condition for the beats of one store; the windows of all `parts` share a table."""
    used = f"used_{table} = '1'"
    return used if len(parts) == 1 else f"{used} and {is_beat(store.beats[0], store.beats[-1])}"


def store_configuration(stores: Sequence[Store], last_beat: int) -> Context:
    """The partials' configuration for `stores` from `stores_of`; `last_beat` is the last beat of the longest frame."""
    tables: list[Context] = []
    conditions: list[list[str]] = []
    for _, group in groupby(stores, lambda store: store.lanes):
        parts = list(group)
        windows = ranges([beat for store in parts for beat in store.beats])
        if len(windows) > _MOST_COMPARED and windows[-1][1] >= _TABLE_BEATS:
            conditions += [[_is_used(len(tables), store, parts)] for store in parts]
            tables.append({"number": len(tables), **_table(windows)})
        else:
            conditions += [enables(store, "position_r", last_beat, is_part=len(parts) > 1) for store in parts]
    return {
        "stores": [
            {
                "suffix": suffix,
                "bits": store.bits,
                "windows": windows,
                "data": store_data(f"fields{suffix}_r", store, "s_axis_tdata"),
            }
            for store, suffix, windows in zip(stores, store_names(stores), conditions, strict=True)
        ],
        "tables": tables,
    }


def store_names(stores: Sequence[Store]) -> list[str]:
    """The suffix of each store's name; empty for a single store."""
    return [""] if len(stores) == 1 else [f"_{number}" for number in range(len(stores))]


def store_data(register: str, store: Store, source: str) -> list[str]:
    """The next value of a store's register at a beat, highest bits first: lanes of `source`, then older content."""
    data = [bits(source, 8 * last + 7, 8 * first) for first, last in reversed(ranges(store.lanes))]
    return data if len(store.beats) == 1 else [*data, bits(register, store.bits - 1, store.beat_bits)]


def stored_slices(piece: Slice, places: StoreMap, registers: Sequence[str]) -> Iterator[Context]:
    """The pieces of a port's slice, each contiguous in a store, for the partial `stored_field`."""
    low = piece.low
    for stored in places.pieces(piece.offset, piece.bytes):
        part = piece if piece.is_bit else replace(piece, low=low, width=8 * stored.count)
        yield {
            "port": part.target,
            # As in roscpp and rospy, any nonzero value of a bool is true.
            "is_bool": piece.is_bit,
            "register": registers[stored.store],
            "high": stored.high,
            "low": stored.low,
        }
        low += 8 * stored.count


def _table(windows: Sequence[tuple[int, int]]) -> Context:
    """The table of beats after which windows begin or end, with a pointer to the next entry."""
    turns = [beat for first, last in windows for beat in (first - 1, last)]
    # A window that begins with the first beat is open from the start.
    is_open = turns[0] < 0
    turns = turns[1:] if is_open else turns
    # After the last entry, the pointer stays on a past beat.
    numbers = [*turns, turns[-1]]
    rows = [numbers[start : start + _NUMBERS_IN_A_ROW] for start in range(0, len(numbers), _NUMBERS_IN_A_ROW)]
    return {
        "is_open": is_open,
        "is_early": turns[0] == 0,
        "last_turn": len(turns),
        "last_beat": turns[-1],
        "turn_bits": len(turns).bit_length(),
        "rows": [", ".join(map(str, row)) for row in rows],
    }
