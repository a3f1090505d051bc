"""Model of the multi-type system: each message is returned unchanged."""

from __future__ import annotations

from typing import Any

Message = dict[str, Any]

_PUBLISHERS = {"twist_in": "twist_out", "scan_in": "scan_out", "image_in": "image_out"}


def respond(subscriber: str, message: Message) -> list[tuple[str, Message]]:
    """The messages that the system publishes when `subscriber` receives `message`."""
    if subscriber not in _PUBLISHERS:
        raise ValueError(f"unknown subscriber '{subscriber}', legal: {', '.join(map(repr, _PUBLISHERS))}")
    return [(_PUBLISHERS[subscriber], message)]
