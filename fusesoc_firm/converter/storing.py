"""The configuration of stores, for the partials `store_signals`, `store_enables`, `store_beats` and `store_resets`.

A template that includes them counts the beats as the stores' are counted, in `position_r`, tells by `is_first` that
beat 0 is there whatever the count is, and has `store_beats` where a beat is taken. A store is enabled by comparisons
with the ends of its windows. Where these are many, a table holds the ends instead, and a pointer walks through it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby

from fusesoc_firm.converter.slices import Slice
from fusesoc_firm.converter.stream import Store, StoreMap, ranges
from fusesoc_firm.converter.vhdl import bits, within
from fusesoc_firm.text.render import Context

# A table takes less logic (45 LUTs and 1.3 a window, where comparisons take 40 and 2.3 at 8 bits) if there are more
# windows, and more beats: the windows among few beats are a small function of the counter.
_MOST_COMPARED = 8
_TABLE_BEATS = 1024
_NUMBERS_IN_A_ROW = 12


def is_beat(first: int, last: int) -> str:
    """The condition for the beats from `first` to `last`."""
    if first > 0:
        return within("position_r", first, last)
    return "is_first = '1'" if last == 0 else f"(is_first = '1' or position_r <= {last})"


def _is_used(table: int, store: Store, parts: Sequence[Store]) -> str:
    """The condition for a beat of a store, one of the `parts` whose windows a table has."""
    used = f"used_{table} = '1'"
    return used if len(parts) == 1 else f"{used} and {is_beat(store.beats[0], store.beats[-1])}"


def store_configuration(stores: Sequence[Store]) -> Context:
    """What the partials need for `stores` as `stores_of` gives them."""
    tables: list[Context] = []
    enables: list[list[str]] = []
    for _, group in groupby(stores, lambda store: store.lanes):
        parts = list(group)
        windows = ranges([beat for store in parts for beat in store.beats])
        if len(windows) > _MOST_COMPARED and windows[-1][1] >= _TABLE_BEATS:
            enables += [[_is_used(len(tables), store, parts)] for store in parts]
            tables.append({"number": len(tables), **_table(windows)})
        else:
            enables += [[is_beat(*window) for window in ranges(store.beats)] for store in parts]
    return {
        "stores": [
            {
                "suffix": suffix,
                "bits": store.bits,
                "windows": windows,
                "data": store_data(f"fields{suffix}_r", store, "s_axis_tdata"),
            }
            for store, suffix, windows in zip(stores, store_names(stores), enables, strict=True)
        ],
        "tables": tables,
    }


def store_names(stores: Sequence[Store]) -> list[str]:
    """What tells the stores apart in names: nothing if there is but one."""
    return [""] if len(stores) == 1 else [f"_{number}" for number in range(len(stores))]


def store_data(register: str, store: Store, source: str) -> list[str]:
    """What a store's register takes with a beat, highest bits first: its lanes of `source`, and what it has."""
    data = [bits(source, 8 * last + 7, 8 * first) for first, last in reversed(ranges(store.lanes))]
    return data if len(store.beats) == 1 else [*data, bits(register, store.bits - 1, store.beat_bits)]


def stored_slices(piece: Slice, places: StoreMap, registers: Sequence[str]) -> Iterator[Context]:
    """The parts of a port's piece that lie in one piece in a store, for the partial `stored_field`."""
    low = piece.low
    for stored in places.pieces(piece.offset, piece.bytes):
        part = piece if piece.is_bit else replace(piece, low=low, width=8 * stored.count)
        yield {
            "port": part.target,
            # As roscpp and rospy read a bool: whatever is not zero is true.
            "is_bool": piece.is_bit,
            "register": registers[stored.store],
            "high": stored.high,
            "low": stored.low,
        }
        low += 8 * stored.count


def _table(windows: Sequence[tuple[int, int]]) -> Context:
    """The table of the beats behind which a window begins or ends, and the pointer to the next of them."""
    turns = [beat for first, last in windows for beat in (first - 1, last)]
    # A window that begins at once is open from the start.
    is_open = turns[0] < 0
    turns = turns[1:] if is_open else turns
    # Behind the last turn the pointer stays on a beat that is past.
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
