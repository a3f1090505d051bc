"""The definitions in rosbags for every ROS distribution, so that common messages do not require ROS."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from functools import cache
from pathlib import Path

from rosbags.typesys import Stores, get_typestore, stores

from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.diagnostics import fail, nearest
from fusesoc_firm.text.files import read_file, write_whole
from fusesoc_firm.tools.digests import digest_of, texts_folder

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
        return frozenset(_texts(self._version, self._name))

    def text(self, name: MessageName) -> str:
        """Return the definition of one of `names` as `.msg` text."""
        return _texts(self._version, self._name)[name]

    def file(self, name: MessageName) -> str:
        """Return the name for a message's definition in errors, in place of a file's name."""
        return f"<{self.title}>/{name}"


@cache
def _texts(version: int, name: str) -> dict[MessageName, str]:
    """Return the texts of all messages in a distribution.

    rosbags takes some 60 ms to load its tables, so the texts are kept in the folder of cached results.
    """
    path = Path(texts_folder(os.environ), f"{name}-{_tables_digest()}.json")
    texts = _kept(path)
    if texts is None:
        texts = _generated(version, name)
        # Without a folder to write to, the next process loads the tables again.
        with suppress(OSError):
            write_whole(path, json.dumps(texts).encode())
    names = (MessageName(*known.split("/msg/")) for known in texts)
    return dict(zip(names, texts.values(), strict=True)) | _ADDED.get(version, {})


def _kept(path: Path) -> dict[str, str] | None:
    """Return the texts in a file, or None if the file is missing or damaged."""
    try:
        texts = json.loads(read_file(path) or b"")
    except ValueError:
        return None
    is_whole = isinstance(texts, dict) and all("/msg/" in name and isinstance(texts[name], str) for name in texts)
    return texts if is_whole else None


def _tables_digest() -> str:
    """Return a digest of the state of the files that contain the tables."""
    with os.scandir(Path(stores.__file__).parent) as files:
        states = sorted((file.path, file.stat().st_size, file.stat().st_mtime_ns) for file in files if file.is_file())
    return digest_of(states)


def _generated(version: int, name: str) -> dict[str, str]:
    store = get_typestore(Stores(name))
    texts = {}
    for known in store.fielddefs:
        # rosbags represents the primitives `time` and `duration` of ROS 1 as messages of ROS 2.
        if version == 2 or not known.startswith("builtin_interfaces/"):
            text, _ = store.generate_msgdef(known, ros_version=version)
            texts[known] = text.partition(_NEXT_DEFINITION)[0]
    return texts
