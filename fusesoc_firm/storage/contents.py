"""The contents of a bag's file, regardless of its format: its channels, and where its messages are."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol


class DamageError(Exception):
    """A file that cannot be read whole: the reason, and the remedy if there is one."""

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(reason)
        self.remedy = remedy


class Channel(NamedTuple):
    """The messages of one topic and type in a file.

    `encoding` is that of the messages (cdr, ros1, json), and `language` that of the definition (ros2msg, ros2idl).
    Without a definition, both it and its language are empty; that of a message without fields may be an empty text.
    `digest` is the type's hash or sum, or empty.
    """

    topic: str
    type: str
    encoding: str
    language: str = ""
    definition: str = ""
    digest: str = ""


@dataclass
class Index:
    """The place of each message in a file, in the file's order: a row of five numbers.

    A stamp is in ns. A message in a chunk begins at a byte of the chunk's content; without chunks, `chunk` is 0.
    """

    channels: array[int] = field(default_factory=lambda: array("q"))
    stamps: array[int] = field(default_factory=lambda: array("Q"))
    chunks: array[int] = field(default_factory=lambda: array("Q"))
    starts: array[int] = field(default_factory=lambda: array("Q"))
    sizes: array[int] = field(default_factory=lambda: array("Q"))

    def add(self, channel: int, stamp: int, chunk: int, start: int, size: int) -> None:
        """Add a message."""
        self.channels.append(channel)
        self.stamps.append(stamp)
        self.chunks.append(chunk)
        self.starts.append(start)
        self.sizes.append(size)

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.channels)


@dataclass
class Contents:
    """The channels of a file by their ids, and the index of all its messages."""

    channels: dict[int, Channel] = field(default_factory=dict)
    index: Index = field(default_factory=Index)

    def check_channels(self) -> None:
        """Raise `DamageError` if a message belongs to an unknown channel."""
        if unknown := {*self.index.channels} - self.channels.keys():
            raise DamageError(f"a message belongs to the unknown channel {min(unknown)}")

    def check_counts(self, expected: Mapping[int, int], source: str) -> None:
        """Raise `DamageError` if the numbers of messages by channel differ from those that a part of the file states.

        `source` is the part's name. Channels without messages may be missing there.
        """
        found = Counter(self.index.channels)
        wrong = sorted(channel for channel in {*found, *expected} if found[channel] != expected.get(channel, 0))
        if wrong:
            raise DamageError("; ".join(self._difference(item, found, expected, source) for item in wrong))

    def _difference(self, channel: int, found: Mapping[int, int], expected: Mapping[int, int], source: str) -> str:
        name = f"topic {self.channels[channel].topic}" if channel in self.channels else f"channel {channel}"
        return difference(name, found[channel], expected.get(channel, 0), source)


def difference(name: str, found: int, expected: int, source: str) -> str:
    """Return the fault of a topic whose number of messages is not the one that `source` states."""
    return f"{name} has {found} messages, but {source} states {expected}"


class BagFile(Protocol):
    """A file of a bag, whose methods raise `DamageError` or `struct.error` if it is damaged.

    `remedy` is that of damage for which the error has none.
    """

    remedy: str

    def __init__(self, file: Path) -> None:
        """Open a file."""

    def check(self) -> None:
        """Raise `DamageError` if the file is not one of its kind or is not whole; called before all else."""

    def channels(self) -> dict[int, Channel]:
        """Return the channels by their ids, from the file's index if it has one."""

    def scan(self) -> Contents:
        """Read the whole file, and compare it with what it says about itself."""

    def payload(self, chunk: int, start: int, size: int) -> bytes:
        """Return a message at a place of the index."""

    def close(self) -> None:
        """Close the file."""
