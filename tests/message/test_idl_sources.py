"""Where `.idl` definitions come from: folders, beside `.msg` files, and the schemas that recorders write into bags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from fusesoc_firm.builds.call.answer import Basis, load, obtain
from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.frame.encoder import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.bag_reader import Form, open_bag
from fusesoc_firm.message.joint import encoding_of
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.bags.writer import RecordedTopic, write_bag
from fusesoc_firm.text.diagnostics import InputError

TILT, PART = parse_name("lab_msgs/Tilt"), parse_name("lab_msgs/Part")
TILT_IDL = """\
#include "geometry_msgs/msg/Point.idl"
module lab_msgs { module msg {
  enum Mode { OFF, ON };
  struct Part { char letter; Mode mode; };
  struct Tilt { long theId; Part part; geometry_msgs::msg::Point at; };
}; };
"""
ADD_IDL = """\
module lab_msgs { module srv {
  module Add_Request_Constants { const int8 ONE = 1; };
  struct Add_Request { int64 a; int64 b; };
  struct Add_Response { int64 sum; };
}; };
"""
ADD, ADD_TEXT = MessageName("lab_msgs", "Add"), "int8 ONE=1\nint64 a\nint64 b\n---\nint64 sum\n"
COUNT_IDL = """\
module lab_msgs { module action {
  struct Count_Goal { int32 to; };
  struct Count_Result { int32 at; };
  struct Count_Feedback { int32 now; };
}; };
"""
COUNT, COUNT_TEXT = MessageName("lab_msgs", "Count"), "int32 to\n---\nint32 at\n---\nint32 now\n"
LINE = "=" * 80
POINT_IDL = "module geometry_msgs { module msg { struct Point { double x; double y; double z; }; }; };\n"
JOINT_IDL = f"{LINE}\nIDL: lab_msgs/msg/Tilt\n{TILT_IDL}\n{LINE}\nIDL: geometry_msgs/msg/Point\n{POINT_IDL}"


FIRM = GENERATORS["firm"]


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def fields(library: MessageLibrary, name: MessageName) -> list[str]:
    return [f"{field.type} {field.name}" for field in library.get(name).fields]


def own_names(library: MessageLibrary) -> list[str]:
    return [str(name) for name in library.names() if not library.origin(name).startswith("rosbags")]


# --- folders --------------------------------------------------------------------------------------------------------


def test_a_file_defines_all_its_structs(tmp_path: Path) -> None:
    file = write(tmp_path / "src/lab_msgs/msg/Tilt.idl", TILT_IDL)
    library = MessageLibrary(ROS2, [tmp_path])
    assert own_names(library) == ["lab_msgs/Part", "lab_msgs/Tilt"]
    closure = library.closure(TILT)
    assert [str(name) for name in closure] == ["lab_msgs/Part", "geometry_msgs/Point", "lab_msgs/Tilt"]
    assert fields(library, PART) == ["char letter", "int32 mode"]
    assert library.files(closure) == [file]
    assert library.content(PART) == TILT_IDL.encode()
    assert own_names(MessageLibrary(ROS1, [tmp_path])) == []


@pytest.mark.parametrize("place", ["lab_msgs/msg/Tilt.msg", "other/lab_msgs/msg/Tilt.msg"])
def test_a_msg_file_precedes_the_idl_file_of_its_name(tmp_path: Path, place: str) -> None:
    write(tmp_path / "lab_msgs/msg/Tilt.idl", TILT_IDL)
    write(tmp_path / place, "float64 angle\n")
    library = MessageLibrary(ROS2, [tmp_path])
    assert library.origin(TILT) == str(tmp_path / place)
    assert fields(library, TILT) == ["float64 angle"]


def test_an_idl_file_beside_a_msg_file_is_ignored(tmp_path: Path) -> None:
    write(tmp_path / "lab_msgs/msg/Tilt.idl", TILT_IDL)
    write(tmp_path / "lab_msgs/msg/Tilt.msg", "float64 angle\n")
    assert own_names(MessageLibrary(ROS2, [tmp_path])) == ["lab_msgs/Tilt"]


def test_services_and_actions(tmp_path: Path) -> None:
    """They have the messages and the hashes of `.srv` and `.action` files."""
    write(tmp_path / "idl/lab_msgs/srv/Add.idl", ADD_IDL)
    write(tmp_path / "idl/lab_msgs/action/Count.idl", COUNT_IDL)
    write(tmp_path / "text/lab_msgs/srv/Add.srv", ADD_TEXT)
    write(tmp_path / "text/lab_msgs/action/Count.action", COUNT_TEXT)
    library, same = (MessageLibrary(ROS2, [tmp_path / folder]) for folder in ("idl", "text"))
    assert own_names(library) == own_names(same)
    for name, kind in ((ADD, InterfaceKind.SERVICE), (COUNT, InterfaceKind.ACTION)):
        interface = library.interface(name, kind)
        assert interface is not None
        hashes = [signature(name, each.joint_closure(interface.messages), kind) for each in (library, same)]
        assert hashes[0] == hashes[1]
    constants = library.get(MessageName("lab_msgs", "Add_Request")).constants
    assert [(item.name, item.value) for item in constants] == [("ONE", 1)]


def test_without_modules_the_folder_is_the_package(tmp_path: Path) -> None:
    write(tmp_path / "flat/One.idl", "struct One { long x; };\n")
    write(tmp_path / "dds/Data.idl", "module Data { struct Msg { long x; Other y; }; struct Other { long z; }; };\n")
    library = MessageLibrary(ROS2, [tmp_path])
    assert own_names(library) == ["Data/Msg", "Data/Other", "flat/One"]
    assert fields(library, MessageName("Data", "Msg")) == ["int32 x", "Data/Other y"]


FAULTY = [
    ("union Tilt switch (long) { case 1: long a; };", "Tilt.idl:1:1: error: unions are not supported in .idl files"),
    (
        "module lab_msgs { module msg { struct Tilt { @optional long a; }; }; };",
        "Tilt.idl:1:46: error: optional fields",
    ),
    ("", "Tilt.idl:1:1: error: the file does not define 'lab_msgs/Tilt'"),
    ("module lab_msgs { module msg { struct Tilt { Missing a; }; }; };", "unknown message 'lab_msgs/Missing'"),
    (
        "module lab_msgs { module msg { struct Tilt { sequence<Tilt> a; }; }; };",
        "message 'lab_msgs/Tilt' contains itself",
    ),
]


@pytest.mark.parametrize(("text", "message"), FAULTY)
def test_faults_are_reported_on_use(tmp_path: Path, text: str, message: str) -> None:
    write(tmp_path / "lab_msgs/msg/Tilt.idl", text)
    library = MessageLibrary(ROS2, [tmp_path])
    with pytest.raises(InputError) as raised:
        library.closure(TILT)
    assert message in str(raised.value)
    assert library.closure(parse_name("geometry_msgs/Point"))


def test_the_names_of_a_service_are_those_of_ros_2(tmp_path: Path) -> None:
    write(tmp_path / "lab_msgs/srv/add_up.idl", ADD_IDL.replace("Add_", "add_up_"))
    with pytest.raises(InputError, match="'add_up_Request' is not a legal message name in ROS 2"):
        MessageLibrary(ROS2, [tmp_path]).get(MessageName("lab_msgs", "add_up_Request"))


def test_different_files_of_one_name(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        write(tmp_path / folder / "lab_msgs/msg/Tilt.idl", f"{TILT_IDL}// {folder}\n")
    with pytest.raises(InputError, match="the definition of 'lab_msgs/Part' differs from the one in"):
        MessageLibrary(ROS2, [tmp_path]).get(PART)


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "lab_msgs/msg/Tilt.idl", TILT_IDL)
    assert main(["message", "show", "lab_msgs/Tilt", "--path", str(tmp_path)]) == 0
    assert "theId" in capsys.readouterr().out
    assert main(["message", "list", "lab_msgs/*", "--path", str(tmp_path)]) == 0
    assert capsys.readouterr().out.count("Tilt.idl") == 2


def test_a_generators_key_covers_the_file_of_its_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "store"))
    file = write(tmp_path / "project/src/lab_msgs/msg/Tilt.idl", TILT_IDL)
    other = write(tmp_path / "project/src/lab_msgs/srv/Add.idl", ADD_IDL)

    def is_stored() -> bool:
        given = {"message": "lab_msgs/Tilt", "ros": 2, "paths": ["src"]}
        call = GeneratorCall("firm", "me:p:a-b:1.0", str(tmp_path / "project"), given)
        request, basis = make_request(call, FIRM.parameters, lambda _: ()), Basis("")
        loaded = load(request, FIRM, basis)
        assert file in loaded.inputs and other not in loaded.inputs
        return obtain(loaded, FIRM, basis)[1].is_from_store

    assert not is_stored()
    assert is_stored()
    other.write_text(ADD_IDL.replace("int64 sum", "int32 sum"))
    assert is_stored()
    file.write_text(TILT_IDL.replace("long theId", "short theId"))
    assert not is_stored()


# --- bags -----------------------------------------------------------------------------------------------------------


def record(folder: Path, kind: str, type_: str, text: str) -> Path:
    """Write a bag with one topic."""
    path = folder / ("drive.bag" if kind == "ros1" else "drive")
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer: Any = Rosbag1Writer(path) if kind == "ros1" else Rosbag2Writer(path, version=9, storage_plugin=plugin)
    facts = {"md5sum": "d41d8cd98f00b204e9800998ecf8427e"} if kind == "ros1" else {"rihs01": "RIHS01_" + "0" * 64}
    with writer:
        connection = writer.add_connection("/t", type_, msgdef=text, **facts)
        writer.write(connection, 0, bytes(9))
    return path


KINDS = ("sqlite3", "mcap")
SCHEMAS = [
    ("lab_msgs/msg/Tilt", JOINT_IDL, "lab_msgs/Tilt", ["int32 theId", "lab_msgs/Part part", "geometry_msgs/Point at"]),
    ("lab_msgs/msg/Tilt", JOINT_IDL, "lab_msgs/Part", ["char letter", "int32 mode"]),
    ("lab_msgs/srv/Add_Event", f"{LINE}\nSRV: lab_msgs/srv/Add\n{ADD_TEXT}", "lab_msgs/Add_Response", ["int64 sum"]),
    ("lab_msgs/srv/Add_Event", f"{LINE}\nIDL: lab_msgs/srv/Add\n{ADD_IDL}", "lab_msgs/Add_Response", ["int64 sum"]),
    (
        "lab_msgs/action/Count_FeedbackMessage",
        f"{LINE}\nACTION: lab_msgs/action/Count\n{COUNT_TEXT}",
        "lab_msgs/Count_FeedbackMessage",
        ["unique_identifier_msgs/UUID goal_id", "lab_msgs/Count_Feedback feedback"],
    ),
    ("lab_msgs/msg/Tilt", f"Stop stop\n{LINE}\nMSG: lab_msgs/Stop", "lab_msgs/Stop", []),
    ("lab_msgs/msg/Tilt", f"{LINE}\nMSG: lab_msgs/msg/Tilt\nint8 a\n", "lab_msgs/Tilt", ["int8 a"]),
    ("lab_msgs/msg/Stop", "", "lab_msgs/Stop", []),
    ("lab_msgs/msg/Stop", f"{LINE}\nMSG: lab_msgs/Other\nint8 a\n", "lab_msgs/Stop", []),
    ("lab_msgs/msg/Stop", " \n", "lab_msgs/Stop", []),
    ("geometry_msgs/msg/Point", "", "geometry_msgs/Point", ["float64 x", "float64 y", "float64 z"]),
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("type_", "text", "name", "expected"), SCHEMAS, ids=range(len(SCHEMAS)))
def test_a_schema_of_a_recorder(
    tmp_path: Path, kind: str, type_: str, text: str, name: str, expected: list[str]
) -> None:
    library = MessageLibrary(ROS2, [record(tmp_path, kind, type_, text)])
    assert fields(library, parse_name(name)) == expected
    assert library.closure(parse_name(name))
    assert library.closure(parse_name(type_))


@pytest.mark.parametrize("kind", KINDS)
def test_a_service_in_a_bag_is_a_service(tmp_path: Path, kind: str) -> None:
    text = f"{LINE}\nSRV: lab_msgs/srv/Add\n{ADD_TEXT}"
    library = MessageLibrary(ROS2, [record(tmp_path, kind, "lab_msgs/srv/Add_Event", text)])
    interface = library.interface(ADD)
    assert interface is not None
    with open_bag(tmp_path / "drive") as bag:
        (stream,) = bag.streams
    assert stream.definition == text
    assert signature(ADD, library.joint_closure(interface.messages), InterfaceKind.SERVICE).startswith("RIHS01_")


@pytest.mark.parametrize("text", ["geometry_msgs/msg/Pint", "geometry_msgs/Pint"])
def test_a_types_name_is_not_a_definition(tmp_path: Path, text: str) -> None:
    bag = record(tmp_path, "mcap", "geometry_msgs/msg/Pint", text)
    with pytest.raises(InputError, match="is a bag without message definitions"):
        MessageLibrary(ROS2, [bag])


def test_a_message_without_fields_in_ros_1(tmp_path: Path) -> None:
    library = MessageLibrary(ROS1, [record(tmp_path, "ros1", "lab_msgs/msg/Stop", "")])
    assert fields(library, parse_name("lab_msgs/Stop")) == []


@pytest.mark.parametrize("language", ["ros2idl", "omgidl"])
def test_idl_without_headers(tmp_path: Path, language: str) -> None:
    bag = tmp_path / "drive.mcap"
    with bag.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("lab_msgs/msg/Tilt", language, TILT_IDL.encode())
        writer.register_channel("/t", "cdr", schema)
        writer.finish()  # type: ignore[no-untyped-call]
    assert fields(MessageLibrary(ROS2, [bag]), PART) == ["char letter", "int32 mode"]


@pytest.mark.parametrize("form", [Form.SQLITE3, Form.MCAP])
def test_a_bag_that_we_write_has_the_definition_as_idl(
    tmp_path: Path, form: Form, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It keeps the names and the hash, which a `.msg` text would change."""
    write(tmp_path / "lab_msgs/msg/Tilt.idl", TILT_IDL)
    definitions = MessageLibrary(ROS2, [tmp_path / "lab_msgs"]).closure(TILT)
    topic = RecordedTopic.of("/tilt", definitions)
    assert encoding_of(topic.definition, ROS2) == "ros2idl"
    value = {"theId": 1, "part": {"letter": 97, "mode": 1}, "at": {"x": 1.0, "y": 2.0, "z": 3.0}}
    bag = tmp_path / ("drive.db3" if form is Form.SQLITE3 else "drive.mcap")
    with write_bag(bag, form, [topic]) as writer:
        writer.write(topic, 1, encode(frame_of(TILT, definitions), value))
    library = MessageLibrary(ROS2, [bag])
    assert signature(TILT, library.closure(TILT)) == topic.signature
    assert [item.value for item in library.get(PART).constants] == [0, 1]
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--from-bag", bag.name, "--in", "/tilt", "--out", "lab_msgs/Tilt"]) == 0
    assert main(["system", "check", "turn/turn.yaml"]) == 0
