"""Determine the bytes of a message with independent serialisers.

The reference for ROS 1 is genpy, which is part of ROS, or rosbags if genpy is not installed. The reference for ROS 2 is
rosbags. If mcap-ros2-support is installed, it must read the same values from the bytes that rosbags wrote.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fusesoc_firm.frame.codec import MessageValue
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.runs.verify import genpy_judge, mcap_judge, rosbags_judge
from fusesoc_firm.runs.verify.definitions import NoJudgementError, with_wide_arrays, with_wide_units

Serialise = Callable[[MessageName, Definitions, Sequence[MessageValue]], list[bytes]]


@dataclass(frozen=True)
class Judgement:
    """The payload of each value, and the serialisers that determined the payloads."""

    payloads: tuple[bytes, ...]
    judge: str


def judge(name: MessageName, definitions: Definitions, values: Sequence[MessageValue]) -> Judgement:
    """Return the payloads of a message's values.

    Raises:
        NoJudgementError: no installed serialiser can read the message, or two serialisers disagree.
    """
    if definitions[name].ros is ROS2:
        return _judge_ros2(name, definitions, values)
    refusals = []
    for title, serialise in ros1_judges():
        try:
            return Judgement(tuple(serialise(name, definitions, values)), title)
        except NoJudgementError as error:
            refusals.append(f"{title}: {error}")
    raise NoJudgementError("; ".join(refusals))


def ros1_judges() -> list[tuple[str, Serialise]]:
    """Return the names and functions of the installed ROS 1 serialisers, the preferred one first."""
    genpy = [(genpy_judge.TITLE, genpy_judge.serialise)] if genpy_judge.is_installed() else []
    return [*genpy, (rosbags_judge.TITLE, rosbags_judge.serialise)]


def versions() -> dict[str, str]:
    """Return the installed references with their versions."""
    found = {
        rosbags_judge.TITLE: rosbags_judge.version(),
        genpy_judge.TITLE: genpy_judge.version(),
        mcap_judge.TITLE: mcap_judge.version(),
    }
    return {title: version for title, version in found.items() if version}


def _judge_ros2(name: MessageName, definitions: Definitions, values: Sequence[MessageValue]) -> Judgement:
    # On the wire, a wstring equals its UTF-16 units in 32 bits each. None of the references supports wstrings.
    values = [with_wide_units(definitions[name], definitions, value) for value in values]
    definitions = with_wide_arrays(definitions)
    payloads = rosbags_judge.serialise(name, definitions, values)
    if not mcap_judge.version():
        return Judgement(tuple(payloads), rosbags_judge.TITLE)
    mcap_judge.check(name, definitions, values, payloads)
    return Judgement(tuple(payloads), f"{rosbags_judge.TITLE}, {mcap_judge.TITLE}")
