"""The configuration of stores, for the partials `store_signals`, `store_enables`, `store_beats` and `store_resets`.

A template that includes them counts the beats as the stores' are counted, in a signal of its own (`Counter.name`), and
has `store_beats` where a beat is taken. A store is enabled by comparisons with the ends of its windows. Where these are
many, a table holds the ends instead, and a pointer walks through it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from fusesoc_firm.converter.ports import vhdl_type
from fusesoc_firm.converter.stream import Store, ranges

Configuration = dict[str, Any]

# A table takes less logic (45 LUTs and 1.3 a window, where comparisons take 40 and 2.3 at 8 bits) if there are more
# windows, and more beats: the windows among few beats are a small function of the counter.
_MOST_COMPARED = 8
_TABLE_BEATS = 1024
_NUMBERS_IN_A_ROW = 12


@dataclass(frozen=True)
class Counter:
    """The signal that counts beats, the condition of the last one, and of beat 0 if the signal may be another then."""

    name: str = "position_r"
    last: str = "s_axis_tlast = '1'"
    start: str = ""

    def is_in(self, first: int, last: int) -> str:
        """The condition for the beats from `first` to `last`."""
        if first == 0 and self.start:
            return self.start if last == 0 else f"({self.start} or {self.name} <= {last})"
        if first == last:
            return f"{self.name} = {first}"
        return f"({self.name} >= {first} and {self.name} <= {last})"


def store_configuration(stores: Sequence[Store], counter: Counter) -> Configuration:
    """What the partials need for `stores` as `stores_of` gives them."""
    tables: list[Configuration] = []
    enables: list[list[str]] = []
    for _, group in groupby(stores, lambda store: store.lanes):
        parts = list(group)
        windows = ranges([beat for store in parts for beat in store.beats])
        if len(windows) > _MOST_COMPARED and windows[-1][1] >= _TABLE_BEATS:
            name = f"_{len(tables)}"
            tables.append(_table(name, windows, counter))
            inside = [counter.is_in(store.beats[0], store.beats[-1]) for store in parts]
            is_one = len(parts) == 1
            enables += [[f"used{name} = '1'" if is_one else f"used{name} = '1' and {place}"] for place in inside]
        else:
            enables += [[counter.is_in(*window) for window in ranges(store.beats)] for store in parts]
    names = store_names(stores)
    return {
        "has_fields": bool(stores),
        "store_signals": _signals(stores),
        "stores": [_store(*item) for item in zip(stores, names, enables, strict=True)],
        "tables": tables,
    }


def store_names(stores: Sequence[Store]) -> list[str]:
    """What tells the stores apart in names: nothing if there is but one."""
    return [""] if len(stores) == 1 else [f"_{number}" for number in range(len(stores))]


def joints(count: int, between: str, behind: str) -> list[str]:
    """What follows each of `count` items: `between`, and `behind` the last one."""
    return [between] * (count - 1) + [behind] if count else []


def _store(store: Store, suffix: str, windows: Sequence[str]) -> Configuration:
    register = f"fields{suffix}_r"
    data = [f"s_axis_tdata({8 * last + 7} downto {8 * first})" for first, last in reversed(ranges(store.lanes))]
    if len(store.beats) > 1:
        data.append(f"{register}({store.bits - 1} downto {store.beat_bits})")
    return {
        "store": f"store{suffix}",
        "register": register,
        "data": [
            {"piece": piece, "joint": joint} for piece, joint in zip(data, joints(len(data), " &", ";"), strict=True)
        ],
        "windows": [
            {"window": window, "joint": joint}
            for window, joint in zip(windows, joints(len(windows), " or", " else '0';"), strict=True)
        ],
    }


def _table(suffix: str, windows: Sequence[tuple[int, int]], counter: Counter) -> Configuration:
    """The table of the beats behind which a window begins or ends, and the pointer to the next of them."""
    turns = [beat for first, last in windows for beat in (first - 1, last)]
    # A window that begins at once is open from the start.
    is_open = turns[0] < 0
    turns = turns[1:] if is_open else turns
    pointer = f"turn{suffix}_r"
    reached = f"{counter.name} = TURNS{suffix}(to_integer({pointer}))"
    if turns[0] == 0 and counter.start:
        reached = f"({counter.start} and {pointer} = 0) or {reached}"
    bits = len(turns).bit_length()
    return {
        "type": f"turns{suffix}_t",
        "table": f"TURNS{suffix}",
        "pointer": pointer,
        "pointer_high": bits - 1,
        "used": f"used{suffix}",
        "value": f"not {pointer}(0)" if is_open else f"{pointer}(0)",
        "reached": reached,
        "last": counter.last,
        # Behind the last turn the pointer stays on a beat that is past.
        "high": len(turns),
        "highest": turns[-1],
        "rows": list(_rows([*turns, turns[-1]])),
    }


def _rows(numbers: Sequence[int]) -> Iterator[Configuration]:
    for start in range(0, len(numbers), _NUMBERS_IN_A_ROW):
        row = ", ".join(map(str, numbers[start : start + _NUMBERS_IN_A_ROW]))
        yield {"row": row, "comma": "," if start + _NUMBERS_IN_A_ROW < len(numbers) else ""}


def _signals(stores: Sequence[Store]) -> list[Configuration]:
    """The declaration of each store and of what makes it take a beat, in columns."""
    declared = []
    for store, suffix in zip(stores, store_names(stores), strict=True):
        declared += [(f"store{suffix}", vhdl_type(None)), (f"fields{suffix}_r", vhdl_type(store.bits))]
    column = max((len(name) for name, _ in declared), default=0)
    return [{"name": name.ljust(column), "type": type_} for name, type_ in declared]
