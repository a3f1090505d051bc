"""What the system of typed.yaml answers."""

from __future__ import annotations

from collections import deque
from typing import Any

INPUTS: dict[str, deque[int]] = {"minuend": deque(), "subtrahend": deque()}


def negated(name: str, value: float) -> float:
    if isinstance(value, float):
        return -value
    if isinstance(value, bool):
        return not value
    bits = {"words": 8, "index": 16, "status": 32, "first": 64}.get(name, 0)
    return ~value % 2**bits if bits else ~value


def respond(subscriber: str, message: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    if subscriber == "sub":
        other = {name: negated(name, value) for name, value in message.items()}
        return [("negated", other), ("copied", message), ("restored", message)]
    INPUTS[subscriber].append(message["data"])
    if not all(INPUTS.values()):
        return []
    difference = INPUTS["minuend"].popleft() - INPUTS["subtrahend"].popleft()
    return [("distance", {"data": difference}), ("sign", {"data": difference < 0})]
