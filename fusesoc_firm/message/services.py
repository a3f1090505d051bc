"""The messages of services and actions: the sections of the files, and the messages that ROS derives from them.

The derived messages follow genaction.py in actionlib_msgs for ROS 1, and `Service` and `Action` in rosidl_parser for
ROS 2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from fusesoc_firm.message import ROS1
from fusesoc_firm.message.idl.parser import parse_idl
from fusesoc_firm.message.middleware import Definitions, MessageDefinition, Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.parser import action_names, dialect_of, parse_message, parse_sections, service_names
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef

# ROS 2 introduced this message, service events and hashes in Iron.
EVENT_INFO = MessageName("service_msgs", "ServiceEventInfo")

# The suffix of a derived message and its text; `{0}` is the name of the service or action.
_Wrappers = Mapping[str, str]

_ROS1_ACTION: _Wrappers = {
    "Action": "{0}ActionGoal action_goal\n{0}ActionResult action_result\n{0}ActionFeedback action_feedback",
    "ActionGoal": "Header header\nactionlib_msgs/GoalID goal_id\n{0}Goal goal",
    "ActionResult": "Header header\nactionlib_msgs/GoalStatus status\n{0}Result result",
    "ActionFeedback": "Header header\nactionlib_msgs/GoalStatus status\n{0}Feedback feedback",
}
_ROS2_ACTION: _Wrappers = {
    "_SendGoal_Request": "unique_identifier_msgs/UUID goal_id\n{0}_Goal goal",
    "_SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp",
    "_GetResult_Request": "unique_identifier_msgs/UUID goal_id",
    "_GetResult_Response": "int8 status\n{0}_Result result",
    "_FeedbackMessage": "unique_identifier_msgs/UUID goal_id\n{0}_Feedback feedback",
}


def _event(service: str) -> str:
    return f"{EVENT_INFO} info\n{service}_Request[<=1] request\n{service}_Response[<=1] response"


_ROS2_SERVICE_EVENT: _Wrappers = {"_Event": _event("{0}")}
_ROS2_ACTION_EVENTS: _Wrappers = {
    "_SendGoal_Event": _event("{0}_SendGoal"),
    "_GetResult_Event": _event("{0}_GetResult"),
}


@dataclass(frozen=True)
class Interface:
    """A service or an action; `has_events` adds the service events of ROS 2, which contain `EVENT_INFO`."""

    name: MessageName
    kind: InterfaceKind
    ros: Middleware
    has_events: bool

    def __str__(self) -> str:
        """Return the full name, such as `std_srvs/srv/SetBool`."""
        return f"{self.name.package}/{self.kind}/{self.name.name}"

    @property
    def messages(self) -> tuple[MessageName, ...]:
        """The names of all messages; the messages that the file itself defines are first."""
        return self._sections + tuple(self._suffixed(suffix) for suffix in self._wrappers)

    @property
    def exchanged(self) -> tuple[MessageName, ...]:
        """The names of the messages that the two ends exchange: all except the events, which ROS 2 itself publishes."""
        events = {self._suffixed(suffix) for suffix in (*_ROS2_SERVICE_EVENT, *_ROS2_ACTION_EVENTS)}
        return tuple(name for name in self.messages if self.ros is ROS1 or name not in events)

    @property
    def has_signature(self) -> bool:
        """Whether ROS defines a signature; ROS 2 distributions without service events have no hashes."""
        return self.ros is ROS1 or self.has_events

    def parse(
        self, text: str, file: str, diagnostics: Diagnostics, is_idl: bool = False
    ) -> dict[MessageName, MessageDefinition]:
        """Parse the file's text into messages; add faults to `diagnostics`, and return the valid parts.

        With `is_idl`, the text is that of an `.idl` file, in which a struct is a section.
        """
        if is_idl:
            sections = self._structs(parse_idl(text, self.name.package, self.ros, file, diagnostics), file, diagnostics)
        else:
            sections = parse_sections(text, self._sections, self.ros, file, diagnostics)
        wrappers = [self._wrapper(suffix, wrapper, file) for suffix, wrapper in self._wrappers.items()]
        return {message.name: replace(message, kind=self.kind) for message in (*sections, *wrappers)}

    @property
    def _sections(self) -> tuple[MessageName, ...]:
        names_of = service_names if self.kind is InterfaceKind.SERVICE else action_names
        return names_of(self.name, self.ros)

    def _structs(self, found: Definitions, file: str, diagnostics: Diagnostics) -> list[MessageDefinition]:
        rule = dialect_of(self.ros).message_name
        for name in self._sections:
            if name not in found:
                needed = " and ".join(section.name for section in self._sections)
                diagnostics.error(f"the struct '{name.name}' is missing", SourceRef(file, 1, 1), f"{self} has {needed}")
            elif not rule.accepts(name.name):
                diagnostics.error(rule.fault(name.name, self.ros.title), found[name].source, rule.hint)
        return [found[name] for name in self._sections if name in found]

    @property
    def _wrappers(self) -> _Wrappers:
        is_action = self.kind is InterfaceKind.ACTION
        if self.ros is ROS1:
            return _ROS1_ACTION if is_action else {}
        wrappers, events = (_ROS2_ACTION, _ROS2_ACTION_EVENTS) if is_action else ({}, _ROS2_SERVICE_EVENT)
        return {**wrappers, **events} if self.has_events else wrappers

    def _suffixed(self, suffix: str) -> MessageName:
        return MessageName(self.name.package, self.name.name + suffix)

    def _wrapper(self, suffix: str, text: str, file: str) -> MessageDefinition:
        """Return a derived message; since its fields are not in the file, their place is the start of the file."""
        # The only possible fault is in the name, which the sections report.
        ignored = Diagnostics()
        definition = parse_message(text.format(self.name.name), self._suffixed(suffix), self.ros, file, ignored)
        fields = tuple(replace(field, source=definition.source) for field in definition.fields)
        return replace(definition, fields=fields)
