"""The topic `/diagnostics`, on which nodes publish their counts each second as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.library import libraries
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.node.interface.topics import NodeTopic, node_topic

NAME = "/diagnostics"
INTERVAL_SECONDS = 1.0
# The time in each interval in which the hardware's status is read.
READING_SECONDS = 0.05
_MESSAGE = MessageName("diagnostic_msgs", "DiagnosticArray")
# The values of DiagnosticStatus.level.
_OK, _WARN = 0, 1
_NS = 10**9


@dataclass(frozen=True)
class Report:
    """The state of a part of the system, by its name: the counts, and whether a count of faults has increased."""

    name: str
    is_warning: bool
    counts: Mapping[str, int]


@cache
def diagnostics_topic(ros: int) -> NodeTopic:
    """Return the topic of a version of ROS."""
    library = libraries([], None, None)[middleware_of(ros)]
    return node_topic("diagnostics", NAME, _MESSAGE, library)


def diagnostics_payload(ros: int, report: Report) -> bytes:
    """Return the serialised message, with the time as its stamp."""
    seconds = {1: ("sec", "nsec"), 2: ("sec", "nanosec")}[ros]
    stamp = dict(zip(seconds, divmod(time.time_ns(), _NS), strict=True))
    header = {"stamp": stamp, "frame_id": ""} | ({"seq": 0} if ros == 1 else {})
    status = {
        "level": _WARN if report.is_warning else _OK,
        "name": report.name,
        "message": "messages were lost or rejected" if report.is_warning else "OK",
        "hardware_id": "",
        "values": [{"key": key, "value": str(count)} for key, count in report.counts.items()],
    }
    return encode(_frame(ros), {"header": header, "status": [status]})


@cache
def _frame(ros: int) -> Frame:
    library = libraries([], None, None)[middleware_of(ros)]
    return frame_of(_MESSAGE, library.closure(_MESSAGE))
