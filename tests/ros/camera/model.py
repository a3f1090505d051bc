"""What the service of the tests answers."""

from typing import Any


def respond(subscriber: str, message: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The response to a request."""
    info = message["camera_info"]
    return [
        (
            subscriber.replace("request", "response"),
            {"success": info["width"] % 2 == 1, "status_message": info["distortion_model"]},
        )
    ]
