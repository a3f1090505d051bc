"""Runs in a Python that has genpy, ROS 1's own serialiser: requests as JSON on stdin, payloads in hex on stdout."""

from __future__ import annotations

import io
import json
import sys
from typing import Any

from genpy.dynamic import generate_dynamic  # type: ignore[import-not-found]


def main() -> None:
    """Answer a list of {name, text, values} with a list of lists of payloads."""
    answers = []
    for request in json.load(sys.stdin):
        message_class = generate_dynamic(request["name"], request["text"])[request["name"]]
        payloads = []
        for value in request["values"]:
            message = message_class()
            fill(message, value)
            buffer = io.BytesIO()
            message.serialize(buffer)
            payloads.append(buffer.getvalue().hex())
        answers.append(payloads)
    json.dump(answers, sys.stdout)


def fill(message: Any, value: dict[str, Any]) -> None:
    """Set every number; a new message already holds the messages, times and arrays within it."""
    for name, inner in value.items():
        if isinstance(inner, dict):
            fill(getattr(message, name), inner)
        elif isinstance(inner, list) and inner and isinstance(inner[0], dict):
            for element, numbers in zip(getattr(message, name), inner, strict=True):
                fill(element, numbers)
        else:
            setattr(message, name, inner)


main()
