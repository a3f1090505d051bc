"""The table of `firm sim`: a row for each message and its responses, in which the most informative fields are first.

A row has the fields of the frames in the host's files. Without these files, it has the labels in the host's report.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from fusesoc_firm.builds.setup.simulation import Message
from fusesoc_firm.runs.simulation.answers import Answer, Payload
from fusesoc_firm.runs.simulation.host_files import is_zero, value_text


def with_answers(messages: Iterable[Message], answers: Sequence[Answer]) -> Iterator[tuple[Message, Sequence[Answer]]]:
    """Yield each message of a report with its responses, in the same order; without responses if they are unknown."""
    first = 0
    for message in messages:
        own = answers[first : first + len(message.received)]
        first += len(message.received)
        yield message, own if [_title(answer.label) for answer in own] == message.received else []


def row(message: Message, answers: Sequence[Answer], width: int) -> list[str]:
    """Return the texts of a message and its responses, each at most `width` long."""
    sent = answers[0].sent if answers else None
    texts = _texts(sent, answers, width) if sent else [message.sent, *(message.received or ["-"])]
    return [text if len(text) <= width else f"{text[: width - 3]}..." for text in texts]


def _title(label: str) -> str:
    """Return a label without the type of the message, as in a report."""
    block, _, rest = label.partition(" ")
    return f"{block} {rest.partition(' ')[2]}".strip()


def _texts(sent: Payload, answers: Sequence[Answer], width: int) -> list[str]:
    """Return the texts of a message and its responses.

    If a text is too long, copied fields are omitted from the message and its responses. If the message is still too
    long, its zero and empty fields are omitted, too.
    """
    texts = [_line(sent, sent.fields), *(_response(answer, answer.expected.fields) for answer in answers)]
    if max(map(len, texts)) <= width:
        return texts
    told = {name for answer in answers for name in sent.fields if not _is_copied(answer, name)}
    changed = {name for answer in answers for name in told & answer.expected.fields.keys()}
    names = sorted(told or sent.fields, key=[*sent.fields].index)
    wrong = {name for answer in answers for name in changed if answer.wrong_fields(name)}
    names.sort(key=lambda name: (name not in wrong, name not in changed, is_zero(sent.fields[name])))
    text = _line(sent, names)
    if len(text) > width:
        text = _line(sent, [name for name in names if name in changed or not is_zero(sent.fields[name])] or names)
    return [text, *(_response(answer, _chosen(answer)) for answer in answers)]


def _chosen(answer: Answer) -> list[str]:
    """Return the names of a response's fields that are not copied: wrong ones, changed ones, others, and zeros.

    If all are copied, return all of them.
    """
    fields, sent = answer.expected.fields, answer.sent.fields if answer.sent else {}
    if not (names := [name for name in fields if not _is_copied(answer, name)]):
        return sorted(fields, key=lambda name: is_zero(fields[name]))
    is_new = {name: name not in sent for name in names}
    return sorted(
        names, key=lambda name: (not answer.wrong_fields(name), is_new[name], is_new[name] and is_zero(fields[name]))
    )


def _is_copied(answer: Answer, name: str) -> bool:
    """Return whether a field of a response has the same value as in the message sent."""
    one, other = answer.sent.fields if answer.sent else {}, answer.expected.fields
    is_equal = name in one and name in other and repr(one[name]) == repr(other[name])
    return is_equal and not answer.wrong_fields(name)


def _response(answer: Answer, names: Iterable[str]) -> str:
    """Return the text of the expected response, in which received values follow wrong ones."""
    words = []
    for name in names:
        wrong = answer.wrong_fields(name)
        words += [f"{item.name}={item.expected} (got {item.received})" for item in wrong] or [
            _word(answer.expected, name)
        ]
    return _joined(answer.expected, words)


def _line(payload: Payload, names: Iterable[str]) -> str:
    return _joined(payload, [_word(payload, name) for name in names])


def _word(payload: Payload, name: str) -> str:
    return f"{name}={value_text(payload.fields[name])}"


def _joined(payload: Payload, words: Iterable[str]) -> str:
    return " ".join((payload.topic.block, *words)).encode("ascii", "replace").decode()
