"""The sources of definitions, their precedence, and the library's messages about missing or faulty ones."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from fusesoc_firm.message import ROS1, ROS2, stores
from fusesoc_firm.message.folders import interface_files
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName, MessageType, PrimitiveType
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.message.stores import DistributionStore, distributions
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, SourceRef
from fusesoc_firm.tools.reads import Reads, noted

POINT = MessageName("geometry_msgs", "Point")


def write(path: Path, text: str = "uint8 x\n") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def field_names(library: MessageLibrary, name: MessageName) -> list[str]:
    return [field.name for field in library.get(name).fields]


def own_names(library: MessageLibrary) -> list[str]:
    """The names of messages from files."""
    return [str(name) for name in library.names() if library.files([name])]


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_common_messages_need_no_files(ros: Middleware) -> None:
    library = MessageLibrary(ros)
    assert field_names(library, POINT) == ["x", "y", "z"]
    assert library.files([POINT]) == []
    assert library.origin(POINT) == ("rosbags ros1_noetic" if ros is ROS1 else "rosbags ros2_jazzy")


def test_a_store_speaks_the_types_of_its_version() -> None:
    header = MessageName("std_msgs", "Header")
    ros1 = {field.name: field.type for field in MessageLibrary(ROS1).get(header).fields}
    ros2 = {field.name: field.type for field in MessageLibrary(ROS2).get(header).fields}
    assert ros1["seq"] == PrimitiveType("uint32")
    assert ros1["stamp"] == PrimitiveType("time")
    assert ros2["stamp"] == MessageType(MessageName("builtin_interfaces", "Time"))
    assert "seq" not in ros2
    assert MessageName("builtin_interfaces", "Time") not in MessageLibrary(ROS1).names()


def test_a_message_of_a_store_points_into_its_text() -> None:
    source = MessageLibrary(ROS1).get(POINT).fields[1].source
    assert str(source) == "<rosbags ros1_noetic>/geometry_msgs/Point:2:1"
    assert source.text == "float64 y"


def test_lyrical_has_other_messages() -> None:
    """Of the messages before it, some are gone, and an event of lifecycle nodes has another field and hash."""
    jazzy, lyrical = (MessageLibrary(ROS2, store=name) for name in ("jazzy", "lyrical"))
    gone = {str(name) for name in jazzy.names()} - {str(name) for name in lyrical.names()}
    assert {"geometry_msgs/Pose2D", "actionlib_msgs/GoalID", "actionlib_msgs/GoalStatus"} <= gone
    with pytest.raises(InputError, match="unknown message 'geometry_msgs/Pose2D'"):
        lyrical.get(MessageName("geometry_msgs", "Pose2D"))
    event = MessageName("lifecycle_msgs", "TransitionEvent")
    assert [field_names(library, event)[0] for library in (jazzy, lyrical)] == ["timestamp", "stamp"]
    hashes = {signature(event, library.closure(event)) for library in (jazzy, lyrical)}
    assert len(hashes) == 2


def test_distributions() -> None:
    assert distributions(1) == ["noetic"]
    assert {"foxy", "humble", "jazzy"} <= set(distributions(2))
    humble = MessageLibrary(ROS2, store="humble")
    assert MessageName("service_msgs", "ServiceEventInfo") not in humble.names()
    assert MessageName("service_msgs", "ServiceEventInfo") in MessageLibrary(ROS2, store="jazzy").names()


def test_an_unknown_distribution() -> None:
    with pytest.raises(InputError) as caught:
        DistributionStore(2, "jazy")
    assert str(caught.value) == "error: unknown ROS 2 distribution 'jazy'\n      = did you mean 'jazzy'?"


def test_definitions_of_a_distribution_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the first process loads the tables of rosbags; a damaged file is replaced."""
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path))
    loaded: list[Stores] = []

    def loading(name: Stores) -> Typestore:
        loaded.append(name)
        return get_typestore(name)

    monkeypatch.setattr(stores, "get_typestore", loading)

    def text() -> str:
        stores._texts.cache_clear()
        return DistributionStore(2).text(POINT)

    assert text() == text() == "float64 x\nfloat64 y\nfloat64 z\n"
    assert len(loaded) == 1
    (file,) = (tmp_path / "definitions").iterdir()
    for damaged in (b"", b"{", b"[]", b'{"geometry_msgs/msg/Point": 1}', file.read_bytes()[:-1]):
        file.write_bytes(damaged)
        loaded.clear()
        assert text() == text() == "float64 x\nfloat64 y\nfloat64 z\n"
        assert len(loaded) == 1
    reads = Reads()
    with noted(reads):
        text()
    assert not [path for path in (*reads.files, *reads.folders) if path.startswith(str(tmp_path))]
    file.unlink()
    file.parent.rmdir()
    file.parent.write_text("not a folder")
    assert text() == "float64 x\nfloat64 y\nfloat64 z\n"


def test_a_package_is_named_by_its_manifest(tmp_path: Path) -> None:
    write(tmp_path / "package.xml", "<package format='2'><name> my_msgs </name></package>")
    write(tmp_path / "msg" / "A.msg")
    assert own_names(MessageLibrary(ROS2, [tmp_path])) == ["my_msgs/A"]
    assert own_names(MessageLibrary(ROS2, [tmp_path / "msg"])) == ["my_msgs/A"]


@pytest.mark.parametrize("manifest", ["", "<package><name>broken", "<package/>"])
def test_a_package_without_a_usable_manifest_is_named_by_its_folder(tmp_path: Path, manifest: str) -> None:
    write(tmp_path / "my_msgs" / "msg" / "A.msg")
    if manifest:
        write(tmp_path / "my_msgs" / "package.xml", manifest)
    for folder in (tmp_path, tmp_path / "my_msgs", tmp_path / "my_msgs" / "msg"):
        assert own_names(MessageLibrary(ROS2, [folder])) == ["my_msgs/A"]


def test_a_relative_folder_knows_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "my_msgs" / "msg" / "A.msg")
    monkeypatch.chdir(tmp_path / "my_msgs")
    library = MessageLibrary(ROS2, [Path("msg")])
    assert own_names(library) == ["my_msgs/A"]
    assert library.origin(MessageName("my_msgs", "A")) == str(Path("msg", "A.msg"))


def test_a_workspace(tmp_path: Path) -> None:
    write(tmp_path / "src" / "repo" / "folder" / "package.xml", "<package><name>declared</name></package>")
    write(tmp_path / "src" / "repo" / "folder" / "msg" / "A.msg")
    write(tmp_path / "src" / "repo" / "folder" / "msg" / "deeper" / "B.msg")
    write(tmp_path / "src" / "by_layout" / "msg" / "C.msg")
    write(tmp_path / "flat" / "D.msg")
    for folder, marker in {"install": "COLCON_IGNORE", "devel": "CATKIN_IGNORE", "old": "AMENT_IGNORE"}.items():
        write(tmp_path / folder / marker, "")
        write(tmp_path / folder / "share" / "copied" / "msg" / "A.msg")
    write(tmp_path / ".git" / "hidden" / "msg" / "E.msg")
    assert own_names(MessageLibrary(ROS2, [tmp_path])) == ["by_layout/C", "declared/A", "declared/B", "flat/D"]


def test_links_are_followed_but_not_in_circles(tmp_path: Path) -> None:
    write(tmp_path / "elsewhere" / "my_msgs" / "msg" / "A.msg")
    workspace = tmp_path / "workspace"
    workspace.mkdir()
    (workspace / "my_msgs").symlink_to(tmp_path / "elsewhere" / "my_msgs")
    (tmp_path / "elsewhere" / "my_msgs" / "back").symlink_to(workspace)
    assert interface_files(workspace)[InterfaceKind.MESSAGE] == {
        MessageName("my_msgs", "A"): [workspace / "my_msgs" / "msg" / "A.msg"],
    }


def test_precedence(tmp_path: Path) -> None:
    first, second, installed = tmp_path / "first", tmp_path / "second", tmp_path / "opt" / "share"
    write(first / "geometry_msgs" / "msg" / "Point.msg", "uint8 from_first\n")
    for folder in (second, installed):
        write(folder / "geometry_msgs" / "msg" / "Point.msg", f"uint8 from_{folder.name}\n")
        write(folder / "geometry_msgs" / "msg" / "Pose.msg", f"uint8 from_{folder.name}\n")
        write(folder / "geometry_msgs" / "msg" / "Twist.msg", f"uint8 from_{folder.name}\n")
    (second / "geometry_msgs" / "msg" / "Twist.msg").unlink()
    library = MessageLibrary(ROS2, [first, second], {"AMENT_PREFIX_PATH": str(tmp_path / "opt")})
    found = {name: field_names(library, MessageName("geometry_msgs", name)) for name in ("Point", "Pose", "Twist")}
    assert found == {"Point": ["from_first"], "Pose": ["from_second"], "Twist": ["from_share"]}
    assert field_names(library, MessageName("geometry_msgs", "Vector3")) == ["x", "y", "z"]


@pytest.mark.parametrize(
    ("ros", "variable", "folder"), [(ROS1, "ROS_PACKAGE_PATH", "share"), (ROS2, "AMENT_PREFIX_PATH", ".")]
)
def test_the_environment_counts_only_if_it_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros: Middleware, variable: str, folder: str
) -> None:
    name = MessageName("my_msgs", "A")
    write(tmp_path / "share" / "my_msgs" / "msg" / "A.msg")
    value = os.pathsep.join(["/does/not/exist", str(tmp_path / folder)])
    monkeypatch.setenv(variable, value)
    assert name not in MessageLibrary(ros).names()
    assert name not in MessageLibrary(ros, environment={}).names()
    assert name in MessageLibrary(ros, environment={variable: value}).names()


def test_every_bad_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError) as caught:
        MessageLibrary(ROS1, [tmp_path / "empty", tmp_path / "missing"])
    assert [diagnostic.message for diagnostic in caught.value.diagnostics] == [
        f"message path '{tmp_path / 'empty'}' contains no .msg, .srv, .action or .idl file",
        f"message path '{tmp_path / 'missing'}' is neither a folder nor a bag",
    ]


def test_two_files_of_one_message_in_a_folder(tmp_path: Path) -> None:
    write(tmp_path / "a" / "my_msgs" / "msg" / "A.msg", "uint8 x\n")
    other = write(tmp_path / "b" / "my_msgs" / "msg" / "A.msg", "uint8 x\n")
    assert field_names(MessageLibrary(ROS2, [tmp_path]), MessageName("my_msgs", "A")) == ["x"]
    other.write_text("uint8 y\n", encoding="utf-8")
    with pytest.raises(InputError, match="'my_msgs/A' differs from"):
        MessageLibrary(ROS2, [tmp_path]).get(MessageName("my_msgs", "A"))


def test_a_file_is_read_once_and_only_when_asked_for(tmp_path: Path) -> None:
    asked = write(tmp_path / "my_msgs" / "msg" / "A.msg")
    write(tmp_path / "my_msgs" / "msg" / "Broken.msg", "nonsense\n")
    library = MessageLibrary(ROS2, [tmp_path])
    definition = library.get(MessageName("my_msgs", "A"))
    asked.unlink()
    assert library.get(MessageName("my_msgs", "A")) is definition


def test_a_broken_file_is_reported_on_every_request(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "msg" / "A.msg", "uint8 x\nnonsense\n")
    library = MessageLibrary(ROS2, [tmp_path])
    for _ in range(2):
        with pytest.raises(InputError, match="2:1: error: 'nonsense' is not followed by a name"):
            library.get(MessageName("my_msgs", "A"))
    diagnostics = Diagnostics()
    definition = library.find(MessageName("my_msgs", "A"), diagnostics)
    assert definition is not None
    assert [field.name for field in definition.fields] == ["x"]
    assert len(diagnostics.found) == 1


def test_an_unknown_message_is_reported_where_it_is_named() -> None:
    place = SourceRef("spec.yaml", 3, 12, "    message: geometry_msgs/Quaternoin", 23)
    with pytest.raises(InputError) as caught:
        MessageLibrary(ROS1).get(MessageName("geometry_msgs", "Quaternoin"), place)
    assert str(caught.value).splitlines()[0] == "spec.yaml:3:12: error: unknown message 'geometry_msgs/Quaternoin'"
    assert str(caught.value).splitlines()[-1] == (
        "      = did you mean 'geometry_msgs/Quaternion'? looked in: rosbags ros1_noetic; "
        "source its ROS workspace, or add its folder with 'paths' in the specification or core, or with --path"
    )


def test_a_message_of_an_unknown_package_is_not_taken_for_another_type() -> None:
    """The packages are similar, as all names of packages are: my_msgs/Foo is not std_msgs/Bool."""
    for name in (MessageName("my_msgs", "Foo"), MessageName("ackermann_msgs", "AckermannDrive")):
        with pytest.raises(InputError) as caught:
            MessageLibrary(ROS2).get(name)
        assert caught.value.diagnostics[0].hint.startswith("looked in: ")


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("Imu", "did you mean 'sensor_msgs/Imu'?"),
        ("geometry_msgs.msg.Point", "did you mean 'geometry_msgs/Point'?"),
        ("geometry_msgs::msg::point", "did you mean 'geometry_msgs/Point'?"),
        ("Foo", "write 'package/Type', such as 'geometry_msgs/Quaternion'"),
    ],
)
def test_a_text_that_is_no_name_gets_the_message_with_its_last_word(text: str, hint: str) -> None:
    with pytest.raises(InputError) as caught:
        MessageLibrary(ROS2).parse(text)
    assert caught.value.diagnostics[0].message == f"'{text}' is not a message name"
    assert caught.value.diagnostics[0].hint == hint


def test_a_closure_holds_each_message_behind_what_it_is_made_of(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "msg" / "Leaf.msg", "geometry_msgs/Point[] points\n")
    write(tmp_path / "my_msgs" / "msg" / "Tree.msg", "Leaf[2] left\nLeaf right\nfloat64 x\n")
    library = MessageLibrary(ROS1, [tmp_path])
    closure = library.closure(MessageName("my_msgs", "Tree"))
    assert [str(name) for name in closure] == ["geometry_msgs/Point", "my_msgs/Leaf", "my_msgs/Tree"]
    assert [path.name for path in library.files(closure)] == ["Leaf.msg", "Tree.msg"]


def test_a_closure_of_ros1_has_no_message_for_time() -> None:
    assert [str(name) for name in MessageLibrary(ROS1).closure(MessageName("std_msgs", "Header"))] == [
        "std_msgs/Header"
    ]


def test_a_closure_reports_every_fault_in_every_file(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "msg" / "A.msg", "B b\nMissing m\nA again\nuint8[0] bad\n")
    write(tmp_path / "my_msgs" / "msg" / "B.msg", "A back\nother_msgs/Missing m\n")
    with pytest.raises(InputError) as caught:
        MessageLibrary(ROS2, [tmp_path]).closure(MessageName("my_msgs", "A"))
    faults = [
        (Path(d.source.file).name, d.source.line, d.message) for d in caught.value.diagnostics if d.source is not None
    ]
    assert faults == [
        ("A.msg", 2, "unknown message 'my_msgs/Missing'"),
        ("A.msg", 3, "message 'my_msgs/A' contains itself"),
        ("A.msg", 4, "'0' is not a legal size"),
        ("B.msg", 1, "message 'my_msgs/A' contains itself"),
        ("B.msg", 2, "unknown message 'other_msgs/Missing'"),
    ]


def test_a_cycle_below_the_message_is_found(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "msg" / "Top.msg", "A a\n")
    write(tmp_path / "my_msgs" / "msg" / "A.msg", "B[] b\n")
    write(tmp_path / "my_msgs" / "msg" / "B.msg", "A a\n")
    with pytest.raises(InputError) as caught:
        MessageLibrary(ROS2, [tmp_path]).closure(MessageName("my_msgs", "Top"))
    (fault,) = caught.value.diagnostics
    assert fault.hint == "my_msgs/A -> my_msgs/B -> my_msgs/A"


@pytest.mark.parametrize(
    ("ros", "words"), [(ROS1, ("any", "union", "map", "Any")), (ROS2, ("Any", "Optional", "Union"))]
)
def test_messages_may_be_called_like_what_msg_has_not(tmp_path: Path, ros: Middleware, words: tuple[str, ...]) -> None:
    folder = tmp_path / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    for word in words:
        (folder / f"{word}.msg").write_text("uint8 any\nuint8 optional\nuint8 union\n")
    (folder / "All.msg").write_text("".join(f"{word} f{n}\nmy_msgs/{word}[] g{n}\n" for n, word in enumerate(words)))
    closure = MessageLibrary(ros, [tmp_path]).closure(MessageName("my_msgs", "All"))
    assert {name.name for name in closure} == {*words, "All"}


# --- messages of tf -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["tf2_msgs/TFMessage", "tf/tfMessage"])
def test_the_transforms_of_ros1_are_known_by_both_names(name: str) -> None:
    message = parse_name(name)
    closure = MessageLibrary(ROS1).closure(message)
    assert signature(message, closure) == "94810edda583a504dfda3829e70d7eec"  # printed by rosmsg md5
    assert [str(field.type) for field in closure[message].fields] == ["geometry_msgs/TransformStamped[]"]
