"""Run the reference model of a simulation: a user's Python file with a function `respond`.

    def respond(subscriber: str, message: dict) -> list[tuple[str, dict]]:

The function receives each sent message, with the name of the subscriber's block. It returns the responses that the
system must send, each with the name of the publisher's block, and the messages to accelerators in software. Fields may
be omitted, as in stimuli. Calls are in the order of the stimuli, and the function may keep state.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.accelerator.message import with_attributes
from fusesoc_firm.accelerator.user_code import UserFunction, load_function
from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import encode_answer
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.text.diagnostics import nearest

NAME, PARAMETERS = "respond", ("subscriber", "message")
ANSWER = "'respond' must return a list of (publisher, message), where the message is a mapping of fields"
"""The name and the parameters of a model's function, and the form of its answer."""


@dataclass(frozen=True)
class Response:
    """A message that the system must send: its payload and its decoded value.

    `cause` is the number, from 0, of the stimulus that causes the response, or None if no single stimulus is known.
    """

    publisher: Topic
    payload: bytes
    message: dict[str, Any]
    cause: int | None


def load_model(path: Path) -> UserFunction:
    """Return the function of the model in `path`. May raise `InputError`."""
    return load_function(path, NAME, "the model", ", ".join(PARAMETERS), ANSWER)


def responses(path: Path, stimuli: Sequence[Stimulus], publishers: Sequence[Topic]) -> list[Response]:
    """Return the responses of the model in `path` to all stimuli. May raise `InputError`, also for faults in the model.

    The model may respond for each of `publishers`.
    """
    return answers(load_model(path), stimuli, publishers, [item.block for item in publishers])


def answers(
    respond: UserFunction, stimuli: Sequence[Stimulus], publishers: Sequence[Topic], names: Sequence[str]
) -> list[Response]:
    """Return the responses of a model like `responses`; its faults suggest only these `names` of publishers."""
    model = _Model(respond, names)
    known = {publisher.block: publisher for publisher in publishers}
    found: list[Response] = []
    for cause, stimulus in enumerate(stimuli):
        when = f"message {cause} to '{stimulus.subscriber.block}'"
        found += [model.response(item, cause, when, known) for item in model.answer(stimulus, when)]
    return found


@dataclass(frozen=True)
class _Model:
    """The user's function; in all methods, `when` names the message for which the function was called."""

    respond: UserFunction
    names: Sequence[str]

    def answer(self, stimulus: Stimulus, when: str) -> list[object]:
        """Return the result of `respond` as a list."""
        with self.respond.guarded(when, [stimulus.message]):
            # A copy, because reports show the original message.
            answer: object = self.respond.call(stimulus.subscriber.block, with_attributes(stimulus.message))
            # If `respond` is a generator, the user's code runs only here.
            items = list(answer) if isinstance(answer, Iterable) and not isinstance(answer, str | Mapping) else None
        if items is None:
            self.respond.fail(f"for {when}, 'respond' returned {answer!r}, which is not a list", ANSWER)
        return items

    def response(self, item: object, cause: int, when: str, known: Mapping[str, Topic]) -> Response:
        """Return an item of the function's result as a response."""
        if not isinstance(item, tuple | list) or len(item) != 2:
            self.respond.fail(f"for {when}, 'respond' returned a list that contains {item!r}", ANSWER)
        block, message = item
        if not isinstance(block, str) or block not in known:
            self.respond.fail(
                f"for {when}, 'respond' returned a message for {block!r}, which is not a publisher",
                nearest(str(block), self.names),
                str(block),
            )
        if not isinstance(message, Mapping):
            self.respond.fail(
                f"for {when}, 'respond' returned {message!r} for '{block}', which is not a mapping of fields", ANSWER
            )
        publisher = known[block]
        try:
            payload = encode_answer(publisher.frame, message)
        except CodecError as error:
            fault = f"for {when}, 'respond' returned an invalid message for '{block}': {error}"
            self.respond.fail(fault, error.hint, error.field)
        return Response(publisher, payload, decode(publisher.frame, payload), cause)
