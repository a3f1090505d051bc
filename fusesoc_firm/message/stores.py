"""The definitions in rosbags for every ROS distribution, so that common messages do not require ROS."""

from __future__ import annotations

from functools import cache

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.text.diagnostics import fail, nearest

# The newest distributions with long-term support that the round-trip tests use.
_DEFAULTS = {1: "noetic", 2: "jazzy"}
_TRANSFORMS = "geometry_msgs/TransformStamped[] transforms\n"
# Messages of tf2 and tf, which most bags contain but which are missing from the tables of rosbags.
_ADDED = {
    1: {
        MessageName("tf2_msgs", "TFMessage"): _TRANSFORMS,
        MessageName("tf", "tfMessage"): _TRANSFORMS,
    }
}
# rosbags separates a message's own text from its nested types with this line.
_NEXT_DEFINITION = "=" * 80


def distributions(version: int) -> list[str]:
    """Return the names of all distributions of a ROS version, such as `jazzy`."""
    prefix = _prefix(version)
    return sorted(store.value.removeprefix(prefix) for store in Stores if store.value.startswith(prefix))


def _prefix(version: int) -> str:
    return f"ros{version}_"


class DistributionStore:
    """The definitions of one distribution.

    The texts are from the tables of rosbags. Names, types, bounds and constants match the distribution, but comments
    and default values are lost, and `Header` of ROS 1 is expanded. `_ADDED` supplies messages missing from the tables.
    """

    def __init__(self, version: int, distribution: str | None = None) -> None:
        """Select one of `distributions`, or the default for None. Raise `InputError` for any other name."""
        chosen = _DEFAULTS[version] if distribution is None else distribution
        if chosen not in distributions(version):
            fail(f"unknown ROS {version} distribution '{chosen}'", hint=nearest(chosen, distributions(version)))
        self._version = version
        self.title = f"rosbags {_prefix(version)}{chosen}"
        self._name = f"{_prefix(version)}{chosen}"

    @property
    def names(self) -> frozenset[MessageName]:
        """The names of all messages in the distribution."""
        return _names(self._version, self._name)

    @property
    def _added(self) -> dict[MessageName, str]:
        return _ADDED.get(self._version, {})

    def text(self, name: MessageName) -> str:
        """Return the definition of one of `names` as `.msg` text."""
        if name in self._added:
            return self._added[name]
        text, _ = _typestore(self._name).generate_msgdef(f"{name.package}/msg/{name.name}", ros_version=self._version)
        return text.partition(_NEXT_DEFINITION)[0]

    def file(self, name: MessageName) -> str:
        """Return the name for a message's definition in errors, in place of a file's name."""
        return f"<{self.title}>/{name}"


@cache
def _typestore(name: str) -> Typestore:
    return get_typestore(Stores(name))


@cache
def _names(version: int, name: str) -> frozenset[MessageName]:
    names = {parse_name(known) for known in _typestore(name).fielddefs} | _ADDED.get(version, {}).keys()
    # rosbags represents the primitives `time` and `duration` of ROS 1 as messages of ROS 2.
    return frozenset(known for known in names if version == 2 or known.package != "builtin_interfaces")
