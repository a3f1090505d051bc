"""The reference that a simulation is compared with: a Python file of the user with a function `respond`.

    def respond(subscriber: str, message: dict) -> list[tuple[str, dict]]:

It gets each message sent, with the name of the subscriber's block, and returns the messages that the system must
send for it, each with the name of its publisher's block. It is called in the order of the stimuli and may keep state.
"""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from fusesoc_firm.diagnostics import SourceRef, fail, nearest
from fusesoc_firm.frame.codec import CodecError
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.host.stimuli import Stimulus
from fusesoc_firm.system.derived import Converter

_MODULE = "_system_model"
_ANSWER = "it returns a list of (publisher, message), the message a mapping of fields"

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
    model = _Model(path, _load(path))
    known = {publisher.block: publisher for publisher in publishers}
    found: list[Response] = []
    for cause, stimulus in enumerate(stimuli):
        when = f"message {cause} to '{stimulus.subscriber.block}'"
        found += [model.response(item, cause, when, known) for item in model.answer(stimulus, when)]
    return found


@dataclass(frozen=True)
class _Model:
    """The user's file and its function. `when`, everywhere, is the message that it was asked for."""

    path: Path
    respond: Respond

    def answer(self, stimulus: Stimulus, when: str) -> list[object]:
        """What `respond` returns, as a list."""
        try:
            # A copy, as the message itself is what the report shows.
            answer: object = self.respond(stimulus.subscriber.block, deepcopy(stimulus.message))
            # A generator runs the user's code only here.
            items = list(answer) if isinstance(answer, Iterable) and not isinstance(answer, str | Mapping) else None
        except (Exception, SystemExit) as error:  # noqa: BLE001 - the user's code may raise anything
            _fail_in_model(self.path, error, f" for {when}", self._line())
        if items is None:
            self._fail(f"for {when}, 'respond' returned {answer!r}, which is not a list", _ANSWER)
        return items

    def response(self, item: object, cause: int, when: str, known: Mapping[str, Converter]) -> Response:
        """An item of an answer."""
        if not isinstance(item, tuple | list) or len(item) != 2:
            self._fail(f"for {when}, 'respond' returned {item!r} in its list", _ANSWER)
        block, message = item
        if not isinstance(block, str) or block not in known:
            self._fail(
                f"for {when}, 'respond' gave a message to {block!r}, not a publisher", nearest(str(block), known)
            )
        if not isinstance(message, Mapping):
            self._fail(
                f"for {when}, 'respond' gave {message!r} to '{block}', which is not a mapping of fields", _ANSWER
            )
        publisher = known[block]
        try:
            return Response(publisher, encode_used(publisher.frame, message), dict(message), cause)
        except CodecError as error:
            self._fail(f"for {when}, what 'respond' gave to '{block}' does not fit: {error}")

    def _fail(self, message: str, hint: str = "") -> NoReturn:
        """Report a fault of what the function returned where the function stands."""
        fail(message, _place(self.path, self._line()), hint)

    def _line(self) -> int:
        """The function's line; 1 if it is none of the file's own."""
        code = getattr(self.respond, "__code__", None)
        return code.co_firstlineno if code is not None and code.co_filename == str(self.path) else 1


def _load(path: Path) -> Respond:
    spec = importlib.util.spec_from_file_location(_MODULE, path)
    if spec is None or spec.loader is None or not path.is_file():
        fail(f"there is no model at {path}", hint="it is a Python file (.py) with a function 'respond'")
    module = importlib.util.module_from_spec(spec)
    # Dataclasses, for one, look their module up.
    sys.modules[_MODULE] = module
    # No __pycache__ beside the user's file.
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - the user's code may raise anything
        _fail_in_model(path, error, "")
    finally:
        sys.dont_write_bytecode = writes
    respond = getattr(module, "respond", None)
    if not callable(respond):
        fail(f"{path} has no function 'respond(subscriber, message)'", hint=_ANSWER)
    return respond  # type: ignore[no-any-return]


def _fail_in_model(path: Path, error: BaseException, when: str, otherwise: int = 1) -> NoReturn:
    """Report an exception at the model's own line that led to it, at the line `otherwise` if there is none."""
    text = f": {error}" if str(error) else ""
    message = f"the model raised {type(error).__name__}{when}{text}"
    if isinstance(error, SyntaxError) and error.filename == str(path):
        line, column = error.lineno or 1, error.offset or 1
        fail(
            f"the model is not Python: {error.msg}",
            SourceRef(str(path), line, column, (error.text or "").rstrip("\n")),
        )
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    if not frames:
        fail(message, _place(path, otherwise))
    fail(message, _place(path, frames[-1].lineno or 1, (frames[-1].colno or 0) + 1))


def _place(path: Path, line: int, column: int = 1) -> SourceRef:
    lines = path.read_text(encoding="utf-8").splitlines()
    return SourceRef(str(path), line, column, lines[line - 1] if line <= len(lines) else "")
