"""The files of a bag: which they are, in which format, and what the metadata beside or in them state."""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath

import yaml

from fusesoc_firm.storage.compression import expand_file
from fusesoc_firm.storage.contents import BagFile, Contents, DamageError, difference
from fusesoc_firm.storage.mcap import McapFile
from fusesoc_firm.storage.ros1 import MAGIC, Ros1File
from fusesoc_firm.storage.sqlite import SqliteFile
from fusesoc_firm.text.yaml_text import yaml_data

METADATA = "metadata.yaml"
_INFORMATION = "rosbag2_bagfile_information"
_COMPRESSED = ".zstd"
_ROS2_FILES: Mapping[str, type[BagFile]] = {".mcap": McapFile, ".db3": SqliteFile}
_REINDEX = "copy the bag again, or count what is left; run: ros2 bag reindex {}"
_MOST_METADATA_BYTES = 2**26


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag, according to the file's name or the folder's contents."""
    if path.is_dir():
        return (path / METADATA).is_file() or any(map(_is_part, path.iterdir()))
    return path.is_file() and (path.suffix == ".bag" or _is_part(path))


def parts_of(path: Path) -> list[Path]:
    """Return the files with the messages of a bag, in order. Raise `DamageError` if the metadata list others."""
    if not path.is_dir():
        return [path]
    there = sorted(filter(_is_part, path.iterdir()), key=_natural)
    metadata = Metadata.beside(path)
    if metadata is None:
        # A recorder writes the metadata last. Without them, the finished part of the bag is still readable.
        if not there:
            raise DamageError(f"the folder contains neither {METADATA} nor a .db3 or .mcap file")
        return there
    known = {_plain_name(file): file for file in there}
    names = [_plain_name(PurePath(name)) for name in metadata.files]
    if missing := [name for name in names if name not in known]:
        raise DamageError(f"{METADATA} lists {missing[0]}, which the folder does not contain", "copy the bag again")
    if others := sorted(known.keys() - {*names}):
        remedy = f"{_REINDEX.format(path)}, or move the file away"
        raise DamageError(f"the folder contains {others[0]}, which {METADATA} does not list", remedy)
    return [known[name] for name in names]


@contextmanager
def opened(path: Path) -> Iterator[BagFile]:
    """Open a file of a bag within the context. Raise `DamageError` if it is not one, or is damaged."""
    with tempfile.TemporaryDirectory(prefix="firm_bag_") as folder:
        name = _plain_name(path)
        content = path
        if path.suffix == _COMPRESSED:
            content = Path(folder, name)
            expand_file(path, content)
        with closing(_kind(content)(content)) as file:
            file.check()
            yield file


@dataclass(frozen=True)
class Metadata:
    """The metadata of a bag of ROS 2: the names of its files, and the numbers of messages by topic and type.

    `digests` are the hashes of types, which files of MCAP lack.
    """

    name: str
    remedy: str
    files: Sequence[str]
    counts: Mapping[tuple[str, str], int]
    digests: Mapping[tuple[str, str], str]
    total: int

    @classmethod
    def beside(cls, folder: Path) -> Metadata | None:
        """Return the metadata in a folder, if it contains some. Raise `DamageError` if they are damaged."""
        file = folder / METADATA
        if not file.exists():
            return None
        remedy = _REINDEX.format(folder)
        if file.stat().st_size > _MOST_METADATA_BYTES:
            raise DamageError(f"{METADATA} has more than {_MOST_METADATA_BYTES} bytes", remedy)
        try:
            return cls.of(file.read_text(encoding="utf-8"), METADATA, remedy)
        except UnicodeDecodeError as error:
            raise DamageError(f"{METADATA} is damaged: {error}", remedy) from error

    @classmethod
    def of(cls, text: str, name: str, remedy: str) -> Metadata:
        """Return the metadata in a text. Raise `DamageError` if they are damaged."""
        counts: Counter[tuple[str, str]] = Counter()
        digests = {}
        try:
            data = yaml_data(text)
            # In a file of messages, this level is missing.
            found = data.get(_INFORMATION, data)
            for item in found["topics_with_message_count"] or []:
                topic = item["topic_metadata"]
                key = str(topic["name"]), str(topic["type"])
                counts[key] += int(item["message_count"])
                digests[key] = str(topic.get("type_description_hash") or "")
            files = [str(file) for file in found["relative_file_paths"] or []]
            total = int(found["message_count"])
        except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
            said = f"the key {error} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())
            raise DamageError(f"{name} is damaged: {said}", remedy) from error
        return cls(name, remedy, files, counts, digests, total)

    def check(self, contents: Sequence[Contents]) -> None:
        """Raise `DamageError` if the bag's files have other numbers of messages."""
        found: Counter[tuple[str, str]] = Counter()
        for each in contents:
            for channel, count in Counter(each.index.channels).items():
                found[each.channels[channel].topic, each.channels[channel].type] += count
        wrong = sorted(key for key in {*found, *self.counts} if found[key] != self.counts.get(key, 0))
        faults = [
            difference(f"topic {topic} ({type_})", found[topic, type_], self.counts.get((topic, type_), 0), self.name)
            for topic, type_ in wrong
        ]
        if not faults and self.total != found.total():
            faults = [difference("the bag", found.total(), self.total, self.name)]
        if faults:
            raise DamageError("; ".join(faults), self.remedy)


def check_own_metadata(file: BagFile, contents: Contents) -> None:
    """Raise `DamageError` if the metadata in a file, which is the only one of its bag, state other numbers."""
    text = file.metadata() if isinstance(file, SqliteFile) else ""
    if text:
        metadata = Metadata.of(text, "the metadata in the file", "copy the bag again")
        # A recorder that still runs, or that has begun another file, has written those of an earlier time.
        if len(metadata.files) == 1 and metadata.total:
            metadata.check([contents])


def _kind(file: Path) -> type[BagFile]:
    if file.is_dir():
        raise DamageError(f"{file} is a folder")
    with file.open("rb") as opened_file:
        is_ros1 = file.suffix == ".bag" or opened_file.read(len(MAGIC)) == MAGIC
    kind = Ros1File if is_ros1 else _ROS2_FILES.get(file.suffix)
    if kind is None:
        raise DamageError(f"'{file.suffix}' is not the ending of a bag")
    return kind


def _is_part(path: Path) -> bool:
    return PurePath(_plain_name(path)).suffix in _ROS2_FILES


def _plain_name(path: PurePath) -> str:
    """Return the name of a file after decompression."""
    return path.name.removesuffix(_COMPRESSED)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return a sort key that orders `bag_10` after `bag_9`."""
    return [(int(digits or 0), text) for text, digits in re.findall(r"(\D*)(\d*)", path.name)]
