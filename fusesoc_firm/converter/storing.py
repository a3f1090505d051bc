"""The configuration of stores, for the partials `store_signals`, `store_enables` and `store_registers`.

A template that includes them counts the beats as the stores' are counted, in a signal of its own (`counter`), and has
the registers where a beat is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fusesoc_firm.converter.ports import vhdl_type
from fusesoc_firm.converter.stream import Store, ranges

Configuration = dict[str, Any]


def store_configuration(stores: Sequence[Store], counter: str = "position_r", start: str = "") -> Configuration:
    """What the partials need. `start` is the condition that tells beat 0, where `counter` may be another then."""
    return {
        "has_fields": bool(stores),
        "store_signals": _signals(stores),
        "stores": [
            _store(store, name, counter, start) for store, name in zip(stores, store_names(stores), strict=True)
        ],
        "tables": [],
    }


def store_names(stores: Sequence[Store]) -> list[str]:
    """What tells the stores apart in names: nothing if there is but one."""
    return [""] if len(stores) == 1 else [f"_{number}" for number in range(len(stores))]


def at_beat(first: int, last: int, counter: str = "position_r", start: str = "") -> str:
    """The condition for the beats from `first` to `last`."""
    if first == 0 and start:
        return start if last == 0 else f"({start} or {counter} <= {last})"
    return f"{counter} = {first}" if first == last else f"({counter} >= {first} and {counter} <= {last})"


def joints(count: int, between: str, behind: str) -> list[str]:
    """What follows each of `count` items: `between`, and `behind` the last one."""
    return [between] * (count - 1) + [behind] if count else []


def _store(store: Store, suffix: str, counter: str, start: str) -> Configuration:
    register = f"fields{suffix}_r"
    data = [f"s_axis_tdata({8 * last + 7} downto {8 * first})" for first, last in reversed(ranges(store.lanes))]
    if len(store.beats) > 1:
        data.append(f"{register}({store.bits - 1} downto {store.beat_bits})")
    windows = [at_beat(first, last, counter, start) for first, last in ranges(store.beats)]
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


def _signals(stores: Sequence[Store]) -> list[Configuration]:
    """The declaration of each store and of what makes it take a beat, in columns."""
    declared = []
    for store, suffix in zip(stores, store_names(stores), strict=True):
        declared += [(f"store{suffix}", vhdl_type(None)), (f"fields{suffix}_r", vhdl_type(store.bits))]
    column = max((len(name) for name, _ in declared), default=0)
    return [{"name": name.ljust(column), "type": type_} for name, type_ in declared]
