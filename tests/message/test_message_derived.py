"""Services and actions: their messages, the origin of these, and their signatures.

Results are compared with genmsg if it can be imported, with the type descriptions of a ROS 2 in AMENT_PREFIX_PATH, and
with a folder that the environment variable CORPUS names. This folder has `ros1/<package>/msg/*.msg`, including
generated messages of actions.
"""

from __future__ import annotations

import json
import os
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.folders import ros2_folders
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MessageDefinition
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.parser import parse_full_name, parse_name
from fusesoc_firm.message.services import Interface
from fusesoc_firm.message.signature import md5, signature
from fusesoc_firm.text.diagnostics import Diagnostics, InputError

SERVICE, ACTION = InterfaceKind.SERVICE, InterfaceKind.ACTION
CORPUS = os.environ.get("CORPUS", "")
INSTALLED = ros2_folders(os.environ)

FIBONACCI = "#goal\nint32 order\n---\n#result\nint32[] sequence\n---\n#feedback\nint32[] sequence\n"
SET_BOOL = "bool data # e.g. for hardware\n---\nbool success\nstring message\n"
ADD = MessageName("my_msgs", "Add")


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def fields(definition: MessageDefinition) -> str:
    return ", ".join(f"{field.type} {field.name}" for field in definition.fields)


def read(text: str, interface: Interface, file: str = "file") -> dict[str, str]:
    """The fields of every message, by the message's name."""
    diagnostics = Diagnostics()
    messages = interface.parse(text, file, diagnostics)
    diagnostics.raise_if_any()
    assert tuple(messages) == interface.messages
    assert {message.kind for message in messages.values()} == {interface.kind}
    return {name.name: fields(message) for name, message in messages.items()}


def faults(library: MessageLibrary, name: MessageName, folder: Path) -> list[str]:
    """The first line of every fault, with places below `folder`."""
    with pytest.raises(InputError) as caught:
        library.closure(name)
    return [str(d).splitlines()[0].removeprefix(f"{folder}/") for d in caught.value.diagnostics]


# --- the derived messages ------------------------------------------------------------------------------------------


def test_a_service_of_ros1() -> None:
    assert read(SET_BOOL, Interface(ADD, SERVICE, ROS1, has_events=False)) == {
        "AddRequest": "bool data",
        "AddResponse": "bool success, string message",
    }


def test_a_service_of_ros2() -> None:
    expected = {"Add_Request": "bool data", "Add_Response": "bool success, string message"}
    assert read(SET_BOOL, Interface(ADD, SERVICE, ROS2, has_events=False)) == expected
    expected["Add_Event"] = (
        "service_msgs/ServiceEventInfo info, my_msgs/Add_Request[<=1] request, my_msgs/Add_Response[<=1] response"
    )
    assert read(SET_BOOL, Interface(ADD, SERVICE, ROS2, has_events=True)) == expected


def test_an_action_of_ros1() -> None:
    assert read(FIBONACCI, Interface(ADD, ACTION, ROS1, has_events=False)) == {
        "AddGoal": "int32 order",
        "AddResult": "int32[] sequence",
        "AddFeedback": "int32[] sequence",
        "AddAction": (
            "my_msgs/AddActionGoal action_goal, my_msgs/AddActionResult action_result, "
            "my_msgs/AddActionFeedback action_feedback"
        ),
        "AddActionGoal": "std_msgs/Header header, actionlib_msgs/GoalID goal_id, my_msgs/AddGoal goal",
        "AddActionResult": "std_msgs/Header header, actionlib_msgs/GoalStatus status, my_msgs/AddResult result",
        "AddActionFeedback": "std_msgs/Header header, actionlib_msgs/GoalStatus status, my_msgs/AddFeedback feedback",
    }


def test_an_action_of_ros2() -> None:
    without_events = read(FIBONACCI, Interface(ADD, ACTION, ROS2, has_events=False))
    assert without_events == {
        "Add_Goal": "int32 order",
        "Add_Result": "int32[] sequence",
        "Add_Feedback": "int32[] sequence",
        "Add_SendGoal_Request": "unique_identifier_msgs/UUID goal_id, my_msgs/Add_Goal goal",
        "Add_SendGoal_Response": "bool accepted, builtin_interfaces/Time stamp",
        "Add_GetResult_Request": "unique_identifier_msgs/UUID goal_id",
        "Add_GetResult_Response": "int8 status, my_msgs/Add_Result result",
        "Add_FeedbackMessage": "unique_identifier_msgs/UUID goal_id, my_msgs/Add_Feedback feedback",
    }
    with_events = read(FIBONACCI, Interface(ADD, ACTION, ROS2, has_events=True))
    assert {name: with_events[name] for name in with_events.keys() - without_events.keys()} == {
        f"Add_{service}_Event": (
            f"service_msgs/ServiceEventInfo info, my_msgs/Add_{service}_Request[<=1] request, "
            f"my_msgs/Add_{service}_Response[<=1] response"
        )
        for service in ("SendGoal", "GetResult")
    }


def test_constants_belong_to_their_section() -> None:
    interface = Interface(ADD, SERVICE, ROS2, has_events=True)
    messages = interface.parse("uint8 A=1\n---\nuint8 A=2\nuint8 B=3\n", "Add.srv", Diagnostics())
    assert [[constant.value for constant in message.constants] for message in messages.values()] == [[1], [2, 3], []]


def test_the_fields_of_a_wrapping_message_point_to_the_file() -> None:
    messages = Interface(ADD, ACTION, ROS1, has_events=False).parse(FIBONACCI, "Add.action", Diagnostics())
    goal, wrapper = messages[MessageName("my_msgs", "AddGoal")], messages[MessageName("my_msgs", "AddActionGoal")]
    assert [str(field.source) for field in goal.fields] == ["Add.action:2:1"]
    assert [str(field.source) for field in wrapper.fields] == ["Add.action:1:1"] * 3
    assert {field.source.text for field in wrapper.fields} == {""}


def test_an_illegal_name_is_reported_for_the_sections_only() -> None:
    diagnostics = Diagnostics()
    Interface(MessageName("my_msgs", "add"), ACTION, ROS2, has_events=True).parse(FIBONACCI, "add.action", diagnostics)
    assert [d.message for d in diagnostics.found] == [
        f"'add_{section}' is not a legal message name in ROS 2" for section in ("Goal", "Result", "Feedback")
    ]


# --- their origin --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("parent", ["my_msgs/srv", "my_msgs"])
def test_a_folder_with_a_service_alone(tmp_path: Path, parent: str) -> None:
    file = write(tmp_path / parent / "Add.srv", SET_BOOL)
    for folder in (tmp_path, tmp_path / "my_msgs", file.parent):
        library = MessageLibrary(ROS2, [folder])
        assert library.interfaces() == {Interface(ADD, SERVICE, ROS2, has_events=True): file}
        assert fields(library.get(parse_name("my_msgs/srv/Add_Request"))) == "bool data"
        assert library.origin(MessageName("my_msgs", "Add_Event")) == str(file)


def test_a_folder_of_services_knows_its_package(tmp_path: Path) -> None:
    write(tmp_path / "my_repository" / "package.xml", "<package><name>my_msgs</name></package>")
    write(tmp_path / "my_repository" / "srv" / "Add.srv", SET_BOOL)
    library = MessageLibrary(ROS1, [tmp_path / "my_repository" / "srv"])
    assert [str(interface) for interface in library.interfaces()] == ["my_msgs/srv/Add"]


def test_the_messages_of_an_action_share_its_file(tmp_path: Path) -> None:
    file = write(tmp_path / "my_msgs" / "action" / "Add.action", FIBONACCI)
    library = MessageLibrary(ROS1, [tmp_path])
    closure = library.closure(MessageName("my_msgs", "AddAction"))
    assert [str(name) for name in closure] == [
        "std_msgs/Header",
        "actionlib_msgs/GoalID",
        "my_msgs/AddGoal",
        "my_msgs/AddActionGoal",
        "actionlib_msgs/GoalStatus",
        "my_msgs/AddResult",
        "my_msgs/AddActionResult",
        "my_msgs/AddFeedback",
        "my_msgs/AddActionFeedback",
        "my_msgs/AddAction",
    ]
    assert library.files(closure) == [file]
    file.unlink()  # a file is read once, as a whole
    assert fields(library.get(MessageName("my_msgs", "AddGoal"))) == "int32 order"


def test_a_distribution_without_events(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "srv" / "Add.srv", SET_BOOL)
    (humble,) = MessageLibrary(ROS2, [tmp_path], store="humble").interfaces()
    (jazzy,) = MessageLibrary(ROS2, [tmp_path], store="jazzy").interfaces()
    assert [name.name for name in humble.messages] == ["Add_Request", "Add_Response"]
    assert [name.name for name in jazzy.messages] == ["Add_Request", "Add_Response", "Add_Event"]
    assert (humble.has_signature, jazzy.has_signature) == (False, True)
    write(tmp_path / "service_msgs" / "msg" / "ServiceEventInfo.msg", "uint8 event_type\n")
    (brought_along,) = MessageLibrary(ROS2, [tmp_path], store="humble").interfaces()
    assert brought_along.messages == jazzy.messages


def test_precedence(tmp_path: Path) -> None:
    write(tmp_path / "first" / "my_msgs" / "srv" / "Add.srv", "uint8 from_first_service\n---\nuint8 x\n")
    write(tmp_path / "first" / "my_msgs" / "msg" / "AddResponse.msg", "uint8 from_first_message\n")
    write(tmp_path / "second" / "my_msgs" / "msg" / "AddRequest.msg", "uint8 from_second_message\n")
    write(tmp_path / "second" / "my_msgs" / "srv" / "Add.srv", "---\n")
    # Each message is requested first in one of the orders, since the file of both is read at once.
    for order in (("AddRequest", "AddResponse"), ("AddResponse", "AddRequest")):
        library = MessageLibrary(ROS1, [tmp_path / "first", tmp_path / "second"])
        found = {name: fields(library.get(MessageName("my_msgs", name))) for name in order}
        assert found == {"AddRequest": "uint8 from_first_service", "AddResponse": "uint8 from_first_message"}
        assert list(library.interfaces().values()) == [tmp_path / "first" / "my_msgs" / "srv" / "Add.srv"]


def test_a_message_and_a_service_of_one_name(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "msg" / "Add.msg", "uint8 x\n")
    write(tmp_path / "my_msgs" / "srv" / "Add.srv", "Add nested\n---\n")
    library = MessageLibrary(ROS2, [tmp_path])
    service = library.interface(ADD, SERVICE)
    assert service is not None
    assert library.interface(ADD) is None
    assert library.interface(ADD, ACTION) is None
    assert str(service) == "my_msgs/srv/Add"
    definitions = library.joint_closure(service.messages)
    assert signature(ADD, definitions) != signature(ADD, definitions, SERVICE)


def test_two_files_of_one_service(tmp_path: Path) -> None:
    first = write(tmp_path / "a" / "my_msgs" / "srv" / "Add.srv", SET_BOOL)
    other = write(tmp_path / "b" / "my_msgs" / "srv" / "Add.srv", SET_BOOL)
    request = MessageName("my_msgs", "AddRequest")
    assert fields(MessageLibrary(ROS1, [tmp_path]).get(request)) == "bool data"
    other.write_text("---\n", encoding="utf-8")
    found = faults(MessageLibrary(ROS1, [tmp_path]), request, tmp_path)
    assert found == [
        f"{first.relative_to(tmp_path)}:1:1: error: the definition of 'my_msgs/srv/Add' differs from the one in {other}"
    ]


# --- faults ------------------------------------------------------------------------------------------------------


def test_every_fault_of_a_file_is_reported_for_each_of_its_messages(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "Add.action", "int23 order\n---\nfloat64 x 1,5\n---\nMissing m\n")
    library = MessageLibrary(ROS2, [tmp_path])
    expected = [
        "my_msgs/Add.action:1:1: error: unknown type 'int23'",
        "my_msgs/Add.action:3:11: error: '1,5' is not a value of float64",
    ]
    assert faults(library, MessageName("my_msgs", "Add_Result"), tmp_path) == expected
    assert faults(library, MessageName("my_msgs", "Add_FeedbackMessage"), tmp_path) == [
        *expected,
        "my_msgs/Add.action:5:1: error: unknown message 'my_msgs/Missing'",
    ]


def test_a_missing_section(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "Add.srv", "uint8 x\n")
    library = MessageLibrary(ROS1, [tmp_path])
    for message in ("AddRequest", "AddResponse"):
        found = faults(library, MessageName("my_msgs", message), tmp_path)
        assert found == ["my_msgs/Add.srv:1:1: error: the file has 1 of the 2 expected sections"]


def test_a_service_is_no_type_of_a_field(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "msg" / "User.msg", "uint8 x\nAdd add\n")
    write(tmp_path / "my_msgs" / "srv" / "Add.srv", SET_BOOL)
    with pytest.raises(InputError) as caught:
        MessageLibrary(ROS1, [tmp_path]).closure(MessageName("my_msgs", "User"))
    (fault,) = caught.value.diagnostics
    assert str(fault.source).endswith("User.msg:2:1")
    assert fault.message == "unknown message 'my_msgs/Add'"
    assert fault.hint == "'my_msgs/Add' is a service with the messages my_msgs/AddRequest, my_msgs/AddResponse"


def test_a_similar_name_of_a_service(tmp_path: Path) -> None:
    write(tmp_path / "my_msgs" / "srv" / "AddTwoInts.srv", SET_BOOL)
    with pytest.raises(InputError, match="did you mean 'my_msgs/AddTwoInts'"):
        MessageLibrary(ROS2, [tmp_path]).get(MessageName("my_msgs", "AddTwoInt"))


# --- signatures --------------------------------------------------------------------------------------------------

SELF_TEST = "---\nstring id\nbyte passed\nDiagnosticStatus[] status\n"
TWO_INTS = "int64 a\nint64 b\n---\nint64 sum\n---\n"
BASIC_TYPES = "".join(
    f"{kind} {kind}_value\n"
    for kind in "bool byte char float32 float64 int8 uint8 int16 uint16 int32 uint32 int64 uint64 string".split()
)


@pytest.mark.parametrize(
    ("file", "text", "expected"),  # as generated by Debian's ros_comm 1.15
    [
        ("std_srvs/srv/Empty.srv", "---", "d41d8cd98f00b204e9800998ecf8427e"),
        ("std_srvs/srv/SetBool.srv", SET_BOOL, "09fb03525b03e7ea1fd3992bafd87e16"),
        ("std_srvs/srv/Trigger.srv", "---\nbool success\nstring message\n", "937c9679a518e3a18d831e57125ea522"),
        ("diagnostic_msgs/srv/SelfTest.srv", SELF_TEST, "ac21b1bab7ab17546986536c22eb34e9"),
        ("actionlib/action/TwoInts.action", TWO_INTS, "6d1aa538c4bd6183a2dfb7fcac41ee50"),
    ],
)
def test_known_md5_sums(tmp_path: Path, file: str, text: str, expected: str) -> None:
    write(tmp_path / file, text)
    library = MessageLibrary(ROS1, [tmp_path])
    (interface,) = library.interfaces()
    definitions = library.joint_closure(interface.messages)
    assert signature(interface.name, definitions, interface.kind) == expected


@pytest.mark.parametrize(
    ("file", "text", "expected"),  # from the type descriptions of ROS 2's packages
    [
        ("std_srvs/srv/SetBool.srv", SET_BOOL, "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"),
        (
            "test_msgs/srv/Empty.srv",
            "---",
            "9737679d04950fecab59b9e82ec2bf285f58446ce8e48d287e13b8a9f19f0823",
        ),
        (
            "test_msgs/srv/BasicTypes.srv",
            f"{BASIC_TYPES}---\n{BASIC_TYPES}",
            "da348697437c103cc9a9322ac1bdbdcf8eb11a85de22f7f2492ca1df416e1a5f",
        ),
        (
            "test_msgs/action/Fibonacci.action",
            FIBONACCI,
            "be9273e3557225044b4a040811112491f7079326e3a573f83258b0b4c30bd069",
        ),
    ],
)
def test_known_hashes(tmp_path: Path, file: str, text: str, expected: str) -> None:
    write(tmp_path / file, text)
    library = MessageLibrary(ROS2, [tmp_path])
    (interface,) = library.interfaces()
    definitions = library.joint_closure(interface.messages)
    assert signature(interface.name, definitions, interface.kind) == f"RIHS01_{expected}"


def test_known_hashes_of_the_messages_of_an_action(tmp_path: Path) -> None:
    write(tmp_path / "test_msgs" / "Fibonacci.action", FIBONACCI)
    library = MessageLibrary(ROS2, [tmp_path])
    (action,) = library.interfaces()
    found = {name.name.removeprefix("Fibonacci_"): signature(name, library.closure(name)) for name in action.messages}
    assert {suffix: hash_text.removeprefix("RIHS01_") for suffix, hash_text in found.items()} == {
        "Goal": "e58ef5a8f4f039ab522a740823547c460b1d5aed8031c8b7825d33d345d90df8",
        "Result": "0774b095467813c6904d475498b5486b7ebd4cda6a4569f97e8de8c862689049",
        "Feedback": "7d1110f2efa019ad5ad8ad2244db98d862f39dc9fae8c976814b0065fa2f32d5",
        "SendGoal_Request": "dfe75c73dc2c090cbc8fd8c45039bfa279d16aa6aadd348f812c6adad26e669e",
        "SendGoal_Response": "1e7e84f7edf1fb020d9e51c7842bceef4cbdbd847f354125f3227cf4f314a683",
        "SendGoal_Event": "a20e708c6aae7a99d1eb0e930a0916f596bb5bae93a342a61752e13135be2c44",
        "GetResult_Request": "c65e93c4c4328d7f1abd6ace83dba8e5fa0f32de76b4d2c96b5c655d94803b92",
        "GetResult_Response": "ef88159d47a3d21d9bf4bec690cf668939d9542db28a9cfd77dbcd97eaf1add2",
        "GetResult_Event": "fe0aa5843ef10550a9b322aeeccd5b11e78bca05b3571cf6999c51bff30c1e23",
        "FeedbackMessage": "37487bae8cea358366b97003c1ef1ca7ce7c08df36f9e8cca496624226aee64e",
    }


# --- the references ----------------------------------------------------------------------------------------------


def genmsg_service(text: str) -> tuple[str, str, str]:
    """The fields of request and response, and the MD5 sum, as genmsg reads them."""
    loader = pytest.importorskip("genmsg.msg_loader")
    gentools = pytest.importorskip("genmsg.gentools")
    context = loader.MsgContext.create_default()
    loader.load_msg_from_string(context, "uint32 seq\ntime stamp\nstring frame_id", "std_msgs/Header")
    spec = loader.load_srv_from_string(context, text, str(ADD))
    request, response = (
        ", ".join(f"{field.type} {field.name}" for field in part.parsed_fields())
        for part in (spec.request, spec.response)
    )
    return request, response, gentools.compute_md5(context, spec)


def test_random_services_against_genmsg(tmp_path: Path) -> None:
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    chance = random.Random(seed)
    lines = ["", "# comment", "Header header", "uint8[] data", "float32 X = 1.50 # x", "string S= a # b ", " time t "]
    separators = ["---", "----", "--- # response"]
    for _ in range(50):
        sections = [chance.sample(lines, chance.randrange(len(lines))) for _ in range(2)]
        text = "\n".join([*sections[0], chance.choice(separators), *sections[1]])
        write(tmp_path / "my_msgs" / "srv" / "Add.srv", text)
        library = MessageLibrary(ROS1, [tmp_path])
        (service,) = library.interfaces()
        definitions = library.joint_closure(service.messages)
        request, response = (fields(definitions[name]) for name in service.messages)
        assert (request, response, md5(ADD, definitions, SERVICE)) == genmsg_service(text), text


def type_descriptions(folder: Path) -> Iterator[dict[str, str]]:
    """Yield ROS 2's own type descriptions: each type's full name and its hash."""
    for path in sorted(folder.glob("*/*/*.json")):
        if path.parent.name in tuple(InterfaceKind):
            yield from json.loads(path.read_text(encoding="utf-8"))["type_hashes"]


@pytest.mark.skipif(not INSTALLED, reason="AMENT_PREFIX_PATH names no ROS 2")
def test_every_type_of_an_installed_ros2() -> None:
    library = MessageLibrary(ROS2, environment=os.environ)
    expected = {entry["type_name"]: entry["hash_string"] for path in INSTALLED for entry in type_descriptions(path)}
    found = {}
    for full_name in expected:
        kind, name = parse_full_name(full_name)
        if interface := library.interface(name, kind):
            definitions = library.joint_closure(interface.messages)
            found[full_name] = signature(name, definitions, interface.kind)
        elif name in library.names():  # skips an action's services, which are unnamed here, and messages of .idl files
            found[full_name] = signature(name, library.closure(name))
    print(f"{len(found)} of {len(expected)} types compared, {len(library.interfaces())} services and actions in all")
    assert found == {full_name: expected[full_name] for full_name in found}
    assert len(found) > 0.9 * len(expected) > 0


@pytest.mark.skipif(not CORPUS, reason="CORPUS names no folder")
def test_corpus_has_the_same_messages_of_actions(tmp_path: Path) -> None:
    corpus = MessageLibrary(ROS1, [Path(CORPUS, "ros1")])
    paths = {name: Path(corpus.origin(name)) for name in corpus.names() if corpus.files([name])}
    compared = 0
    for name, path in paths.items():
        if not name.name.endswith("ActionGoal"):
            continue
        stem = name.name.removesuffix("ActionGoal")
        sections = [path.with_name(f"{stem}{part}.msg").read_text() for part in ("Goal", "Result", "Feedback")]
        write(tmp_path / name.package / "action" / f"{stem}.action", "\n---\n".join(sections))
        compared += 1
    # Messages that the actions use come from the corpus, which has the generators' own versions of the same messages.
    library = MessageLibrary(ROS1, [tmp_path, Path(CORPUS, "ros1")])
    actions = [interface for interface in library.interfaces() if interface.kind is ACTION]
    different = [
        str(message)
        for action in actions
        for message in action.messages
        if signature(message, library.closure(message)) != signature(message, corpus.closure(message))
        or fields(library.get(message)) != fields(corpus.get(message))
    ]
    assert all(library.origin(message).startswith(str(tmp_path)) for action in actions for message in action.messages)
    print(f"ROS 1: {7 * compared} messages of {compared} actions compared")
    assert different == []
    assert len(actions) == compared > 0
