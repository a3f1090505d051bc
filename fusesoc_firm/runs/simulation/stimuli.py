"""Read the messages to send to a system from a YAML file or a recorded bag.

A YAML file is a list; each item consists of the name of a subscriber's block and a message:

    - QuaternionToEuler_sub: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}

Fields may be omitted; they are sent with their defaults, or as zero or empty, as `ros2 topic pub` does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.frame.codec import decode, encode
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.runs.simulation.yaml_message import read_message
from fusesoc_firm.system.derived.model import DerivedSystem, Topic
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, SourceRef, closest, fail, nearest
from fusesoc_firm.text.yaml_text import LARGE, YamlText, is_null, kind, read_yaml

_YAML_SUFFIXES = (".yaml", ".yml")
# The number of subscribers named in the message about a missing file.
_SHOWN = 3


@dataclass(frozen=True)
class Stimulus:
    """A message for a subscriber: its payload, as serialised by the middleware, and its decoded value."""

    subscriber: Topic
    payload: bytes
    message: dict[str, Any]


def read_stimuli(
    path: Path,
    subscribers: Sequence[Topic],
    system: DerivedSystem | None = None,
    libraries: Mapping[Middleware, MessageLibrary] | None = None,
    most: int | None = None,
) -> list[Stimulus]:
    """Return all messages in a file or bag, in order. May raise `InputError`, also for a file without messages.

    In a bag, the calls of services of `system`, and the goals and cancellations of its actions, are messages, too.
    Of a bag, `most` messages at most are read.
    """
    fields = "{<field>: <value>, ...}"
    items = ", ".join(f"'- {subscriber.block}: {fields}'" for subscriber in subscribers[:_SHOWN])
    legal = f"a bag, or a YAML file with a list of messages: {items}"
    if not path.exists():
        near = closest(path.name, [item.name for item in path.parent.glob("*") if _may_be_stimuli(item)])
        fail(f"the stimuli {path} do not exist", hint=f"did you mean '{near}'?" if near else f"legal here: {legal}")
    if path.suffix in _YAML_SUFFIXES:
        stimuli = _from_yaml(path, subscribers)
    else:
        # A hit must not spend time on importing the readers of rosbags.
        from fusesoc_firm.message.bag_reader import BAGS
        from fusesoc_firm.runs.bags.routes import read_bag

        hint = f"stimuli are a YAML file (.yaml, .yml) or a bag; {BAGS}"
        found = read_bag(path, subscribers, hint, system, libraries)
        stimuli = [_recorded(path, *message) for message in islice(found, most)]
    if not stimuli:
        names = ", ".join(subscriber.block for subscriber in subscribers)
        place = SourceRef(str(path), 1, 1) if path.suffix in _YAML_SUFFIXES else None
        fail(f"{path} contains no message for {names}", place, f"legal here: {legal}")
    return stimuli


def _may_be_stimuli(path: Path) -> bool:
    """Return whether a file is a bag or contains a list; other files, such as specifications, are not suggested."""
    with suppress(InputError):
        return path.suffix not in _YAML_SUFFIXES or isinstance(read_yaml(path, bounds=LARGE).root, yaml.SequenceNode)
    return False


def _recorded(path: Path, subscriber: Topic, payload: bytes, message: dict[str, Any]) -> Stimulus:
    if _is_too_long(subscriber, payload):
        fault, hint = _length_fault(subscriber, payload)
        fail(f"{path}: {fault}", hint=hint)
    return Stimulus(subscriber, payload, message)


def _is_too_long(subscriber: Topic, payload: bytes) -> bool:
    return subscriber.max_length is not None and len(payload) > subscriber.max_length


def _length_fault(subscriber: Topic, payload: bytes) -> tuple[str, str]:
    """Return the fault of a message that is longer than its subscriber accepts, and a hint."""
    size = len(payload)
    fault = f"a message has {size} bytes, but '{subscriber.block}' accepts {subscriber.max_length}"
    return fault, f"add 'maxLength: {size}' or more to the block"


def _from_yaml(path: Path, subscribers: Sequence[Topic]) -> list[Stimulus]:
    faults = Diagnostics()
    text = read_yaml(path, faults=faults, bounds=LARGE)
    known = {subscriber.block: subscriber for subscriber in subscribers}
    if isinstance(text.root, yaml.SequenceNode):
        stimuli = [_item(text, node, known, faults) for node in text.root.value]
    else:
        stimuli = []
        if text.root is not None and not is_null(text.root):
            faults.error(
                f"stimuli must be a list, not {kind(text.root)}",
                text.source(text.root),
                "an item has the form '- <subscriber>: {<field>: <value>, ...}'",
            )
    faults.raise_if_any()
    return [stimulus for stimulus in stimuli if stimulus is not None]


def _item(text: YamlText, node: yaml.Node, known: dict[str, Topic], faults: Diagnostics) -> Stimulus | None:
    """Return one item of the list; if the item is not a message, note the faults and return None."""
    if not isinstance(node, yaml.MappingNode) or len(node.value) != 1:
        faults.error("a stimulus must be one subscriber with its message: '- <subscriber>: {...}'", text.source(node))
        return None
    key, value = node.value[0]
    subscriber = known.get(key.value) if isinstance(key, yaml.ScalarNode) else None
    if subscriber is None:
        faults.error(f"{kind(key)} is not a subscriber", text.source(key), nearest(str(key.value), known))
        return None
    before = len(faults.found)
    message = read_message(text, value, subscriber.frame, faults)
    if len(faults.found) > before:
        return None
    payload = encode(subscriber.frame, completed(subscriber.frame, message))
    if _is_too_long(subscriber, payload):
        fault, hint = _length_fault(subscriber, payload)
        faults.error(fault, text.source(value), hint)
        return None
    return Stimulus(subscriber, payload, decode(subscriber.frame, payload))
