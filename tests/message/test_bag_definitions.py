"""Messages that only a bag defines: found by `--path` and a generator's `paths`, and their part in the store's key."""

from __future__ import annotations

import os
import shutil
import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from fusesoc_firm.builds.call.answer import Basis, load, obtain
from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import GeneratedCore, GeneratorCall, Request
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.facts import state
from fusesoc_firm.tools.reads import Part, Reads, noted

KINDS = ("ros1", "sqlite3", "mcap")
ODD = parse_name("odd_msgs/Odd")
LINE = "=" * 80
TEXT = f"Inner inner\ngeometry_msgs/Point at\nuint8 KEPT=3\n{LINE}\nMSG: odd_msgs/Inner\nuint16[2] pair\n"
POINT = f"{LINE}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"


def version(kind: str) -> Middleware:
    return ROS1 if kind == "ros1" else ROS2


def record(
    folder: Path, kind: str, texts: dict[str, str], *, name: str = "drive", count: int = 1, size: int = 9
) -> Path:
    """Write a bag with a topic for each type and invalid payloads; a blank at the end makes a type distinct."""
    path = folder / (f"{name}.bag" if kind == "ros1" else name)
    shutil.rmtree(path, ignore_errors=True)
    path.unlink(missing_ok=True)
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer: Any = Rosbag1Writer(path) if kind == "ros1" else Rosbag2Writer(path, version=9, storage_plugin=plugin)
    with writer:
        for number, (type_, text) in enumerate(texts.items()):
            facts = {"md5sum": "0" * 32} if kind == "ros1" else {"rihs01": "RIHS01_" + "0" * 64}
            connection = writer.add_connection(f"/t{number}", type_.strip(), msgdef=text, **facts)
            for time in range(count):
                writer.write(connection, time, bytes(size))
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_defines_what_no_store_has(tmp_path: Path, kind: str) -> None:
    bag = record(tmp_path, kind, {"odd_msgs/msg/Odd": TEXT + POINT})
    (tmp_path / "files/odd_msgs").mkdir(parents=True)
    (tmp_path / "files/odd_msgs/Odd.msg").write_text(TEXT.partition(LINE)[0])
    (tmp_path / "files/odd_msgs/Inner.msg").write_text("uint16[2] pair\n")
    ros = version(kind)
    library, same = MessageLibrary(ros, [bag]), MessageLibrary(ros, [tmp_path / "files"])
    assert signature(ODD, library.closure(ODD)) == signature(ODD, same.closure(ODD))
    assert library.origin(ODD) == str(bag)
    assert library.get(ODD).fields[0].source.file == f"<{bag}>/odd_msgs/Odd"
    assert library.files([ODD]) == [Part(bag, "odd_msgs/Odd", library.content(ODD))]
    # The bag precedes the distribution, and does not affect the other version of ROS.
    assert library.origin(parse_name("geometry_msgs/Point")) == str(bag)
    other = ROS2 if ros is ROS1 else ROS1
    assert ODD not in MessageLibrary(other, [bag]).names()


@pytest.mark.parametrize("kind", KINDS)
def test_on_the_command_line(tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    bag = record(tmp_path, kind, {"odd_msgs/msg/Odd": TEXT + POINT})
    assert main(["message", "show", "odd_msgs/Odd", "--ros", str(version(kind).number), "--path", str(bag)]) == 0
    assert "    pair  " in capsys.readouterr().out


@pytest.mark.parametrize("kind", KINDS)
def test_definitions_that_differ_are_refused_when_asked_for(tmp_path: Path, kind: str) -> None:
    texts = {"odd_msgs/msg/Odd": "uint8 a # one\n", "odd_msgs/msg/Odd ": "uint8 a # two\n"}
    library = MessageLibrary(version(kind), [record(tmp_path, kind, texts)])
    # Comments do not count as a difference. ROS 2 stores only one definition of a type anyway.
    assert [field.name for field in library.get(ODD).fields] == ["a"]
    outer = {
        "odd_msgs/msg/A": f"Odd o\n{LINE}\nMSG: odd_msgs/Odd\nuint8 a\n",
        "odd_msgs/msg/B": f"Odd o\n{LINE}\nMSG: odd_msgs/Odd\nuint8 b\n",
    }
    bag = record(tmp_path, kind, outer)
    library = MessageLibrary(version(kind), [bag])
    with pytest.raises(InputError) as raised:
        library.get(ODD)
    assert f"<{bag}>/odd_msgs/Odd:1:1: error: the bag has different definitions of 'odd_msgs/Odd'" in str(raised.value)


def test_what_is_no_bag_or_has_no_definitions(tmp_path: Path) -> None:
    (tmp_path / "drive.bag").write_bytes(b"nothing")
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError) as raised:
        MessageLibrary(ROS1, [tmp_path / "drive.bag", tmp_path / "notes.txt"])
    assert "drive.bag is not a readable bag" in str(raised.value)
    assert "notes.txt' is neither a folder nor a bag" in str(raised.value)
    empty = record(tmp_path, "mcap", {})
    with pytest.raises(InputError, match="drive' is a bag without message definitions"):
        MessageLibrary(ROS2, [empty])


# --- the store ----------------------------------------------------------------------------------------------------


FIRM = GENERATORS["firm"]


class Calls:
    """Calls of the generator `firm` for a message that a bag next to the core defines."""

    def __init__(self, root: Path, kind: str) -> None:
        self.root = root
        self.kind = kind
        self.bag = record(root, kind, {"odd_msgs/msg/Odd": TEXT + POINT})

    def request(self) -> Request:
        given = {"message": "odd_msgs/Odd", "ros": version(self.kind).number, "paths": [self.bag.name]}
        call = GeneratorCall("firm", "me:p:a-b:1.0", str(self.root), given)
        return make_request(call, FIRM.parameters, lambda _: ())

    def is_stored(self) -> bool:
        request, basis = self.request(), Basis("")
        return obtain(load(request, FIRM, basis), FIRM, basis)[1].is_from_store


@pytest.mark.parametrize("kind", KINDS)
def test_the_key_covers_the_definitions_alone(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "store"))
    (tmp_path / "project").mkdir()
    calls = Calls(tmp_path / "project", kind)
    assert not calls.is_stored()
    assert calls.is_stored()
    # More messages with the same definitions, and definitions of unused messages.
    record(calls.root, kind, {"odd_msgs/msg/Odd": TEXT + POINT, "odd_msgs/msg/Other": "uint8 a\n"}, count=3)
    assert calls.is_stored()
    record(calls.root, kind, {"odd_msgs/msg/Odd": TEXT.replace("uint16[2]", "uint16[3]") + POINT})
    assert not calls.is_stored()


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_is_read_in_part_and_never_whole(tmp_path: Path, kind: str) -> None:
    calls = Calls(tmp_path, kind)
    reads = Reads()
    with noted(reads):
        (part, *_) = FIRM.load(calls.request()).inputs
    files = [calls.bag] if calls.bag.is_file() else sorted(calls.bag.iterdir())
    assert isinstance(part, Part)
    assert [*reads.parts] == [str(file) for file in files]
    assert not {str(file) for file in files} & reads.files.keys()


@pytest.mark.parametrize("kind", KINDS)
def test_whoever_reads_the_bag_itself_must_declare_it(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "store"))
    (tmp_path / "project").mkdir()
    calls = Calls(tmp_path / "project", kind)
    file = calls.bag if calls.bag.is_file() else next(calls.bag.glob("*.mcap" if kind == "mcap" else "*.db3"))
    request, basis = calls.request(), Basis("")
    loaded = load(request, FIRM, basis)

    def generate() -> GeneratedCore:
        if kind == "sqlite3":
            sqlite3.connect(f"file:{file}?mode=ro", uri=True).close()
        else:
            file.read_bytes()
        return loaded.generate()

    with pytest.raises(InputError, match="was read, but is not listed as an input"):
        obtain(replace(loaded, generate=generate), FIRM, basis)


def test_a_repeated_call_is_recalled_until_the_bag_is_touched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = record(tmp_path, "ros1", {"odd_msgs/msg/Odd": TEXT + POINT})
    before = state("part", str(bag))
    assert before == state("part", str(bag)) is not None
    os.utime(bag, ns=(1, 1))
    assert state("part", str(bag)) != before
    assert state("part", str(tmp_path / "none")) is None
