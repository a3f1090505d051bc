"""What the system of names.yaml answers."""

from __future__ import annotations


def respond(subscriber: str, message: dict[str, float]) -> list[tuple[str, dict[str, float]]]:
    assert subscriber == "manager"
    rotated = {"x": message["z"], "y": message["x"], "z": message["y"]}
    return [(publisher, rotated) for publisher in ("arm/left__joint", "m_axis", "2nd")]
