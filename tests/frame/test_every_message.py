"""Messages of any size: our bytes, values and lengths against independent serialisers.

The references are rosbags for both versions and, if it is installed, genpy, ROS 1's own. The messages are those of all
distributions, random ones, and all in the folder that the environment variable CORPUS names
(`ros1/<package>/msg/*.msg`, `ros2/...`).
"""

from __future__ import annotations

import os
import random
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fusesoc_firm.frame import decoder, encoder
from fusesoc_firm.frame.codec import decode, decode_arrays, encode, trimmed, used_bytes
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.length import length_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import ArrayType, FieldType, MessageName, SequenceType, StringType
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import EMPTY, KINDS, ONE, Stimuli
from fusesoc_firm.text.diagnostics import InputError
from tests.frame.genpy_oracle import GenpyOracle, has_genpy
from tests.frame.oracle import DefinitionsOracle, Oracle, is_same
from tests.frame.random_messages import random_texts

CORPUS = os.environ.get("CORPUS", "")
RANDOM_DEFINITIONS = 80

Serialise = Callable[[Mapping[str, Any]], bytes]
needs_genpy = pytest.mark.skipif(not has_genpy, reason="genpy is not installed")
needs_corpus = pytest.mark.skipif(not CORPUS, reason="CORPUS names no folder")


def new_seed() -> random.Random:
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    return random.Random(seed)


def check(frame: Frame, serialise: Serialise, value: Mapping[str, Any], kind: str) -> None:
    """Compare all our results for a value and its bytes with the bytes of a reference."""
    payload = serialise(value)
    used = used_bytes(frame, payload)
    told = f"{frame.message}: {value}"
    assert encode(frame, value) == bytes(byte if use else 0 for byte, use in zip(payload, used, strict=True)), told
    assert is_same(decode(frame, payload), value), told
    arrays = decode_arrays(frame, payload)
    assert is_same(lists_of(arrays), lists_of(value)), told
    assert encode(frame, arrays) == encode(frame, value), told
    if frame.ros is ROS2:
        assert trimmed(frame, payload + b"\xff" * 9) == payload, told
    length = length_of(frame)
    assert length.of(value) == len(payload), told
    assert length.minimum <= len(payload), told
    assert length.maximum is None or len(payload) <= length.maximum, told
    if kind == EMPTY:
        assert length.minimum == len(payload), told
    # The content of padding must have no effect.
    garbage = bytes(byte if use else byte ^ 0xA5 for byte, use in zip(payload, used, strict=True))
    assert is_same(decode(frame, garbage), value), told


def lists_of(value: Any) -> Any:
    """A message with lists instead of arrays and bytes."""
    if isinstance(value, dict):
        return {name: lists_of(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [lists_of(inner) for inner in value]
    return [*value] if isinstance(value, bytes) else value.tolist() if isinstance(value, np.ndarray) else value


def check_all(
    name: MessageName, definitions: Mapping[MessageName, MessageDefinition], serialise: Serialise, chance: random.Random
) -> None:
    ros = definitions[name].ros
    frame = frame_of(name, definitions)
    stimuli = Stimuli(definitions, ros, chance)
    for kind in KINDS:
        check(frame, serialise, stimuli.message(name, kind), kind)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("ros", "distribution"), [(ros, name) for ros in (ROS1, ROS2) for name in ros.distributions()])
def test_every_message_of_a_distribution_against_rosbags(ros: Middleware, distribution: str) -> None:
    chance = new_seed()
    oracle = Oracle(ros, distribution=distribution)
    assert len(oracle.messages()) > 130
    for name in oracle.messages():
        check_all(parse_name(name), oracle.closure(name), rosbags(oracle, name), chance)


def test_generated_functions_need_no_second_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check of a value, and the walk through a payload, are only for faults."""
    monkeypatch.setattr(encoder, "_checked", None)
    monkeypatch.setattr(decoder, "_ranges", None)
    chance = new_seed()
    for ros in (ROS1, ROS2):
        oracle = Oracle(ros)
        for name in oracle.messages():
            frame, definitions = oracle.frame(name), oracle.closure(name)
            value = decode(
                frame, oracle.serialise(name, Stimuli(definitions, ros, chance).message(parse_name(name), ONE))
            )
            assert is_same(decode(frame, encode(frame, value)), value)
            assert encode(frame, decode_arrays(frame, encode(frame, value))) == encode(frame, value)


@needs_genpy
def test_every_message_of_a_distribution_against_genpy() -> None:
    chance = new_seed()
    oracle = Oracle(ROS1)
    for name in oracle.messages():
        definitions = oracle.closure(name)
        check_all(parse_name(name), definitions, GenpyOracle(parse_name(name), definitions).serialise, chance)


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_random_definitions_against_rosbags(ros: Middleware) -> None:
    chance = new_seed()
    for _ in range(RANDOM_DEFINITIONS):
        texts = random_texts(ros, chance)
        oracle = Oracle(ros, texts)
        name = list(texts)[-1]
        try:
            check_all(parse_name(name), oracle.closure(name), rosbags(oracle, name), chance)
        except AssertionError:
            print(texts)
            raise


@needs_genpy
def test_random_definitions_against_genpy() -> None:
    chance = new_seed()
    for _ in range(RANDOM_DEFINITIONS // 4):
        texts = random_texts(ROS1, chance)
        name = parse_name(list(texts)[-1])
        definitions = Oracle(ROS1, texts).closure(list(texts)[-1])
        check_all(name, definitions, GenpyOracle(name, definitions).serialise, chance)


# --- the corpus --------------------------------------------------------------------------------------------------


def corpus(ros: Middleware) -> Iterator[tuple[MessageName, dict[MessageName, MessageDefinition]]]:
    """Yield every message whose nested messages are all known, with these."""
    library = MessageLibrary(ros, [Path(CORPUS, f"ros{ros.number}")])
    unknown = Counter[str]()
    for path in sorted(Path(CORPUS, f"ros{ros.number}").glob("*/msg/*.msg")):
        name = MessageName(path.parts[-3], path.stem)
        try:
            yield name, library.closure(name)
        except InputError as error:
            unknown[error.diagnostics[0].message] += 1
    print(f"ROS {ros.number}: left out, since the folder does not hold all they need: {dict(unknown)}")


@needs_corpus
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_the_corpus_against_rosbags(ros: Middleware) -> None:
    chance = new_seed()
    messages = dict(corpus(ros))
    everything = {name: definition for closure in messages.values() for name, definition in closure.items()}
    oracle = DefinitionsOracle(ros, everything)
    wide = {name for name, closure in messages.items() if any(map(has_wstring, closure.values()))}
    left_out = {name for name, closure in messages.items() if not oracle.refused.keys().isdisjoint(closure)} | wide
    different = []
    for name in messages.keys() - left_out:
        try:
            check_all(name, messages[name], rosbags(oracle, str(name)), chance)
        except AssertionError as error:
            different.append(f"{name}: {str(error)[:300]}")
    print(f"ROS {ros.number}: {len(messages) - len(left_out)} messages, {len(KINDS)} stimuli each")
    print(f"left out: {len(wide)} with wstring, refused by rosbags: {oracle.refused}")
    assert different == []
    assert len(messages) > 1000 > 10 * len(left_out)


@needs_corpus
@needs_genpy
def test_the_corpus_against_genpy() -> None:
    chance = new_seed()
    different, refused, compared = [], Counter[str](), 0
    for name, definitions in corpus(ROS1):
        try:
            oracle = GenpyOracle(name, definitions)
        except Exception as error:  # noqa: BLE001 - it raises exceptions of many types
            refused[f"{type(error).__name__}: {error}"] += 1
            continue
        try:
            check_all(name, definitions, oracle.serialise, chance)
            compared += 1
        except AssertionError as error:
            different.append(f"{name}: {str(error)[:300]}")
    print(f"ROS 1: {compared} messages, {len(KINDS)} stimuli each; refused by genpy: {dict(refused)}")
    assert different == []
    assert compared > 1000


def has_wstring(definition: MessageDefinition) -> bool:
    """Whether the definition contains a wstring, which rosbags does not support."""

    def is_wide(type_: FieldType) -> bool:
        element = type_.element if isinstance(type_, ArrayType | SequenceType) else type_
        return isinstance(element, StringType) and element.is_wide

    return any(is_wide(field.type) for field in definition.fields)


def rosbags(oracle: Oracle, name: str) -> Serialise:
    return lambda value: oracle.serialise(name, value)
