"""The reference that a simulation is compared with: a Python file of the user with a function `respond`.

    def respond(subscriber: str, message: dict) -> list[tuple[str, dict]]:

It gets each message sent, with the name of the subscriber's block, and returns the messages that the system must
send for it, each with the name of its publisher's block. It is called in the order of the stimuli and may keep state.
"""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from fusesoc_firm.diagnostics import SourceRef, fail, nearest
from fusesoc_firm.frame.codec import CodecError, encode
from fusesoc_firm.host.stimuli import Stimulus
from fusesoc_firm.system.derived import Converter

Respond = Callable[[str, dict[str, Any]], list[tuple[str, dict[str, Any]]]]


@dataclass(frozen=True)
class Response:
    """A message that the system must send; `cause` is the number, from 0, of the stimulus that it answers."""

    publisher: Converter
    payload: bytes
    message: dict[str, Any]
    cause: int


def responses(path: Path, stimuli: Sequence[Stimulus], publishers: Sequence[Converter]) -> list[Response]:
    """What the model in `path` answers to all stimuli. Raises `InputError`, also for a fault within the model."""
    respond = _load(path)
    known = {publisher.block: publisher for publisher in publishers}
    found: list[Response] = []
    for cause, stimulus in enumerate(stimuli):
        try:
            answer = list(respond(stimulus.subscriber.block, stimulus.message))
        except Exception as error:  # noqa: BLE001 - the user's code may raise anything
            _fail_in_model(path, error, f" for message {cause} to '{stimulus.subscriber.block}'")
        found += [_response(path, item, cause, known) for item in answer]
    return found


def _response(path: Path, item: object, cause: int, known: dict[str, Converter]) -> Response:
    if not isinstance(item, tuple) or len(item) != 2:
        fail(f"{path}: respond returned {item!r}; each item is (publisher, message)")
    block, message = item
    if block not in known:
        fail(f"{path}: respond answered with '{block}', which is no publisher", hint=nearest(str(block), known))
    publisher = known[block]
    try:
        return Response(publisher, encode(publisher.frame, message), message, cause)
    except CodecError as error:
        fail(f"{path}: respond's answer to message {cause} does not fit '{block}': {error}")


def _load(path: Path) -> Respond:
    spec = importlib.util.spec_from_file_location("_system_model", path)
    if spec is None or spec.loader is None or not path.is_file():
        fail(f"there is no model at {path}; it is a Python file with a function 'respond'")
    module = importlib.util.module_from_spec(spec)
    # No __pycache__ beside the user's file.
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # noqa: BLE001 - the user's code may raise anything
        _fail_in_model(path, error, "")
    finally:
        sys.dont_write_bytecode = writes
    respond = getattr(module, "respond", None)
    if not callable(respond):
        fail(f"{path} has no function 'respond(subscriber, message)'")
    return respond  # type: ignore[no-any-return]


def _fail_in_model(path: Path, error: Exception, when: str) -> NoReturn:
    """Report an exception of the model at the model's own line."""
    message = f"the model raised {type(error).__name__}{when}: {error}"
    if isinstance(error, SyntaxError) and error.filename == str(path):
        fail(message, SourceRef(str(path), error.lineno or 1, error.offset or 1, (error.text or "").rstrip("\n")))
    lines = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    if not lines:
        fail(f"{path}: {message}")
    last = lines[-1]
    text = path.read_text(encoding="utf-8").splitlines()[(last.lineno or 1) - 1]
    fail(message, SourceRef(str(path), last.lineno or 1, (last.colno or 0) + 1, text))
