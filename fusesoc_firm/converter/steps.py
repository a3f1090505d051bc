"""The properties of a program's steps as tables, indexed by step number, for the subscriber's template."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fusesoc_firm.converter.program import (
    Block,
    Count,
    Drop,
    End,
    Header,
    Open,
    Padding,
    Step,
    Stream,
    Tail,
    comment,
    has_bytes,
    opens_data,
)
from fusesoc_firm.frame.model import COUNT_BYTES, LENGTH_BYTES, Data, Loop
from fusesoc_firm.text.render import Context

_WORD_BITS = 32
# Not a multiple of 32, so GHDL loses no row (`is_lossy`).
_DIGITS_IN_A_ROW = 60
_NUMBERS_IN_A_ROW = 16


def is_fixed(step: Step) -> bool:
    """Whether a step consumes a known number of bytes."""
    return isinstance(step, Header | Block | Count)


def fixed_size(step: Step) -> int:
    """The number of bytes of a fixed step; 0 for any other step."""
    match step:
        case Header():
            return LENGTH_BYTES
        case Count():
            return COUNT_BYTES
        case Block(size=size):
            return size
    return 0


def is_counted(step: Step) -> bool:
    """Whether the step opens a part whose number of elements is on the wire."""
    return isinstance(step, Open) and (isinstance(step.part, Data) or step.part.count is None)


def is_count_whole(lanes: int) -> bool:
    """Whether a beat holds a whole count, or the payload's length."""
    return lanes >= COUNT_BYTES


def is_hollow(step: Step) -> bool:
    """Whether the step opens an array whose elements take no bytes."""
    return isinstance(step, Open) and isinstance(step.part, Loop) and not has_bytes(step.part)


def terminator_of(part: Data | Loop) -> int:
    """The number of terminating zeros that a part's count includes."""
    return part.terminator if isinstance(part, Data) else 0


def is_text(step: Step) -> bool:
    """Whether the step opens a text with a terminating zero."""
    return isinstance(step, Open) and terminator_of(step.part) > 0


def closes_text(step: Step) -> bool:
    """Whether the first byte of the step is a text's terminating zero."""
    return (isinstance(step, Block) and step.checks == ((0, b"\x00"),)) or closes_with_padding(step)


def closes_with_padding(step: Step) -> bool:
    """Whether the step takes a text's terminating zero and the padding after it."""
    return isinstance(step, Padding) and step.closes_text


def element_size(step: Step) -> int:
    """The size in bytes of an element of the stream that the step opens; 0 for any other step."""
    return step.part.element.size if isinstance(step, Open) and isinstance(step.part, Data) else 0


def alignment_of(step: Step) -> int:
    """The alignment that padding establishes; 0 for any other step."""
    return step.alignment if isinstance(step, Padding) else 0


def is_stream(step: Step) -> bool:
    """Whether the previous step determines the number of bytes of the step."""
    return isinstance(step, Stream | Drop)


def _takes(step: Step) -> bool:
    return is_fixed(step) or is_stream(step) or isinstance(step, Padding)


def _settles(step: Step) -> bool:
    """Whether the step decides a cycle before it acts."""
    return isinstance(step, Tail | End)


def _is_text_count(step: Step) -> bool:
    return isinstance(step, Count | Open) and terminator_of(step.part) > 0


def _size_is(size: int) -> Callable[[Step], bool]:
    return lambda step: element_size(step) == size


# The sets of steps that a template uses; empty sets are omitted.
_SETS: tuple[tuple[str, str, Callable[[Step], bool]], ...] = (
    ("TAKES", "Takes bytes.", _takes),
    ("IS_FIXED", "Takes a known number of bytes.", is_fixed),
    ("IS_STREAM", "Hands bytes on, or drops them.", is_stream),
    ("IS_COUNT", "Takes a count.", lambda step: isinstance(step, Count)),
    ("IS_PADDING", "Takes padding.", lambda step: isinstance(step, Padding)),
    ("IS_OPEN", "Knows a count.", is_counted),
    ("IS_TEXT", "Takes or knows a count that includes a closing zero.", _is_text_count),
    ("CLOSES_TEXT", "Begins with that zero.", closes_text),
    ("IS_HOLLOW", "Its elements take no bytes.", is_hollow),
    ("OPENS_DATA", "A stream follows.", opens_data),
    ("HAS_2", "Its elements have 2 bytes.", _size_is(2)),
    ("HAS_4", "Its elements have 4 bytes.", _size_is(4)),
    ("HAS_8", "Its elements have 8 bytes.", _size_is(8)),
)
# The names of the sets in VHDL, in lower case.
SET_NAMES = frozenset(
    f"{kind}_{name}".lower()
    for kind in ("step", "next")
    for name in ("SETTLES", "IS_BEAT", "HANDS", "TELLS", *(name for name, _, _ in _SETS))
) | {"next_aligns_to_2", "next_aligns_to_4"}


@dataclass(frozen=True)
class StepSet:
    """A further set, with the steps in it by number, and the register that tells whether the current step is in it."""

    name: str
    about: str
    members: frozenset[int]
    register: str


def step_sets(steps: Sequence[Step], lanes: int, further: Sequence[StepSet] = ()) -> list[Context]:
    """The sets as rows of digits, one digit for each step, on a stream with this number of lanes."""
    sets = (
        *_SETS,
        ("SETTLES", "Decides in its first cycle, and acts in the next one.", _settles),
        ("IS_BEAT", "Takes a known number of bytes, in one beat.", lambda step: 0 < fixed_size(step) <= lanes),
    )
    found = []
    for name, about, is_in in sets:
        digits = "".join(str(int(is_in(step))) for step in steps)
        if "1" in digits or name == "IS_BEAT":
            found.append({"name": name, "about": about, "rows": digit_rows(digits)})
    for each in further:
        digits = "".join(str(int(number in each.members)) for number in range(len(steps)))
        found.append({"name": each.name, "about": each.about, "rows": digit_rows(digits)})
    return found


def is_lossy(entries: int) -> bool:
    """Whether GHDL 2.0 may lose a table of `entries` bits.

    A constant of 64, 96, ... bits becomes zero if only its highest 32 bits contain ones. Such a table therefore gets
    one more bit, which is zero and never read.
    """
    return entries > _WORD_BITS and entries % _WORD_BITS == 0


def digit_rows(digits: str) -> list[str]:
    """The rows of a descending table with one digit for each step."""
    digits = ("0" if is_lossy(len(digits)) else "") + digits[::-1]
    return [digits[start : start + _DIGITS_IN_A_ROW] for start in range(0, len(digits), _DIGITS_IN_A_ROW)]


_REGISTERS = {
    "TAKES": ("wants_r", "it takes bytes"),
    "SETTLES": ("settles_r", "it decides in this cycle, and acts in the next one"),
    "IS_BEAT": ("ends_r", "its bytes in the next beat are its last ones, if that is known"),
    "IS_FIXED": ("fixed_r", "its number of bytes is known"),
    "IS_STREAM": ("stream_r", "it is a stream"),
    "IS_PADDING": ("padded_r", "it is padding"),
    "IS_COUNT": ("count_r", "it takes a count"),
    "CLOSES_TEXT": ("closes_r", "its next byte ends a text"),
    "IS_OPEN": ("counted_r", "it knows a count"),
    "IS_TEXT": ("text_r", "it takes or knows a text's count, which includes a terminating zero"),
    "OPENS_DATA": ("opens_r", "of a stream"),
    **{f"HAS_{size}": (f"has_{size}_r", f"with elements of {size} bytes") for size in (2, 4, 8)},
}


def step_classes(sets: Sequence[Context], further: Sequence[StepSet] = ()) -> list[Context]:
    """The sets that a subscriber registers for its current step."""
    names = {found["name"] for found in sets}
    classes = [
        {"set": name, "register": register, "about": about}
        for name, (register, about) in _REGISTERS.items()
        if name in names
    ]
    return [
        *classes,
        *({"set": each.name, "register": each.register, "about": each.about} for each in further),
    ]


def number_rows(numbers: Sequence[int]) -> list[str]:
    """The rows of a descending table with one number for each step."""
    numbers = numbers[::-1]
    rows = [numbers[start : start + _NUMBERS_IN_A_ROW] for start in range(0, len(numbers), _NUMBERS_IN_A_ROW)]
    return [", ".join(map(str, row)) for row in rows]


def step_list(steps: Sequence[Step]) -> list[str]:
    """The list of steps at the head of an architecture."""
    column = len(str(len(steps) - 1))
    return [f"{number:>{column}}  {_description(step)}" for number, step in enumerate(steps)]


def _description(step: Step) -> str:
    kind = type(step).__name__.lower()
    if isinstance(step, Block):
        size = f"{step.size} byte{'' if step.size == 1 else 's'}"
        return f"{kind:8} {size}: {comment(step)}" if comment(step) else f"{kind:8} {size}"
    return f"{kind:8} {comment(step)}".rstrip()
