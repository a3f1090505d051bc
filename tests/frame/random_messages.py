"""Random definitions: small, deeply nested, and with every feature that affects positions on the wire."""

from __future__ import annotations

import random

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.middleware import Middleware

PACKAGE = "random_msgs"
_NUMBERS = ["bool", "uint8", "int8", "int16", "uint32", "float32", "float64", "int64"]


def random_texts(ros: Middleware, chance: random.Random, count: int = 5) -> dict[str, str]:
    """`count` messages, by name; each may contain those before it."""
    names: list[str] = []
    texts = {}
    for number in range(count):
        fields = [_field(ros, chance, names) for _ in range(chance.randint(0 if number < 2 else 1, 4))]
        texts[f"{PACKAGE}/M{number}"] = "".join(f"{type_} f{place}\n" for place, type_ in enumerate(fields))
        names.append(f"M{number}")
    return texts


def _field(ros: Middleware, chance: random.Random, names: list[str]) -> str:
    type_ = chance.choice(_NUMBERS)
    if names and chance.random() < 0.5:
        type_ = chance.choice(names)
    elif chance.random() < 0.25:
        bounds = ["", "", "<=2", "<=5"] if ros is ROS2 else [""]
        type_ = f"string{chance.choice(bounds)}"
    sizes = ["", "", "", "[]", "[]", "[1]", "[2]", "[3]"]
    return type_ + chance.choice([*sizes, "[<=1]", "[<=3]"] if ros is ROS2 else sizes)


def deep_texts(ros: Middleware, chance: random.Random, levels: int) -> dict[str, str]:
    """Messages `L0` to `L<levels - 1>`, by name: each contains the one before it, among other fields."""
    sizes = ["", "[]", "[1]", "[2]", *(["[<=1]", "[<=3]"] if ros is ROS2 else [])]
    texts = {}
    for level in range(levels):
        fields = [_field(ros, chance, []) for _ in range(chance.randint(1, 3))]
        if level:
            fields.insert(chance.randint(0, len(fields)), f"L{level - 1}{chance.choice(sizes)}")
        texts[f"{PACKAGE}/L{level}"] = "".join(f"{type_} f{place}\n" for place, type_ in enumerate(fields))
    return texts
