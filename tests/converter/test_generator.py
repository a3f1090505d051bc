"""The generator `firm` with requests for a message, a service, an action, or a configuration file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.converter.converter_core import load
from fusesoc_firm.converter.interfaces import interface_configuration
from fusesoc_firm.converter.order import order_of_config
from fusesoc_firm.core.request import GeneratedCore, Plain, Request
from fusesoc_firm.message.library import libraries
from fusesoc_firm.text.diagnostics import InputError
from tests.expected import check_expected

GOLDEN = Path(__file__).parent / "golden"

# The dissertation's listing 5.1, unchanged.
LISTING_5_1 = """\
project:
  name: Sobel Filter
  platform:
    board: zcu104
    FPGA: xczu7ev-ffvc1156-2-e
messages:
  - type: ROS           # supported middleware
    name: sensor_msgs/Image # message specification
    subscribers:
      - AXIS2Image      # names for interfaces
    publishers:
      - Image2AXIS      # to middleware used by
                        # accelerators
"""

SERVICE = "int64 a\nint64 b\n---\nint64 sum\n"
ACTION = "int32 order\n---\nint32 sum\n---\nint32 step\n"


def request(folder: Path, **parameters: Plain) -> Request:
    known: dict[str, Plain] = {"direction": "both", "width": 8, "paths": ["."]}
    return Request("firm", "me:robots:arm-grip:1.0", folder, known | parameters)


@pytest.fixture
def demo(tmp_path: Path) -> Path:
    """A folder with a package of a message, a service and an action of fixed size."""
    for kind, name, text in (("msg", "Grip", "bool closed\n"), ("srv", "Add", SERVICE), ("action", "Count", ACTION)):
        (tmp_path / "demo_msgs" / kind).mkdir(parents=True)
        (tmp_path / "demo_msgs" / kind / f"{name}.{kind}").write_text(text)
    return tmp_path


def made(folder: Path, config: str) -> GeneratedCore:
    (folder / "robot.yaml").write_text(config)
    return load(request(folder, config="robot.yaml")).generate()


def stems(core: GeneratedCore) -> list[str]:
    return [name.removesuffix(".vhd") for name in core.files]


# --- services and actions ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("demo_msgs/Add_Request", "demo_msgs_add_request"),
        ("demo_msgs/srv/Add_Response", "demo_msgs_add_response"),
        ("demo_msgs/Count_Goal", "demo_msgs_count_goal"),
        ("demo_msgs/action/Count_Result", "demo_msgs_count_result"),
        ("demo_msgs/Count_Feedback", "demo_msgs_count_feedback"),
        ("demo_msgs/Count_SendGoal_Request", "demo_msgs_count_sendgoal_request"),
        ("demo_msgs/action/Count_SendGoal_Response", "demo_msgs_count_sendgoal_response"),
        ("demo_msgs/Count_GetResult_Request", "demo_msgs_count_getresult_request"),
        ("demo_msgs/Count_GetResult_Response", "demo_msgs_count_getresult_response"),
        ("demo_msgs/Count_FeedbackMessage", "demo_msgs_count_feedbackmessage"),
        ("service_msgs/ServiceEventInfo", "service_msgs_serviceeventinfo"),
        ("action_msgs/msg/GoalInfo", "action_msgs_goalinfo"),
    ],
)
def test_a_message_of_a_service_or_an_action_is_one_like_any_other(demo: Path, name: str, stem: str) -> None:
    core = load(request(demo, message=name, ros=2)).generate()
    assert stems(core) == [f"{stem}_pkg", f"axis_to_{stem}", f"{stem}_to_axis"]


@pytest.mark.parametrize("name", ["AddRequest", "AddResponse", "CountGoal", "CountResult", "CountFeedback"])
def test_the_names_of_ros_1(demo: Path, name: str) -> None:
    core = load(request(demo, message=f"demo_msgs/{name}", ros=1)).generate()
    assert f"axis_to_demo_msgs_{name.lower()}" in stems(core)


@pytest.mark.parametrize("name", ["demo_msgs/Add", "demo_msgs/srv/Add"])
def test_a_service_is_all_that_its_ends_exchange(demo: Path, name: str) -> None:
    core = load(request(demo, message=name, ros=2, direction="subscriber")).generate()
    assert stems(core) == [
        "demo_msgs_add_request_pkg",
        "demo_msgs_add_response_pkg",
        "axis_to_demo_msgs_add_request",
        "axis_to_demo_msgs_add_response",
    ]
    assert re.fullmatch(r"Converters of demo_msgs/srv/Add \(ROS 2, RIHS01_\w{64}\)", core.description)
    assert [*load(request(demo, message=name, ros=2)).inputs] == [demo / "." / "demo_msgs" / "srv" / "Add.srv"]


def test_an_action_is_its_goal_result_and_feedback_and_what_is_around_them(demo: Path) -> None:
    files = stems(load(request(demo, message="demo_msgs/action/Count", ros=2)).generate())
    parts = (
        "goal result feedback sendgoal_request sendgoal_response getresult_request getresult_response feedbackmessage"
    )
    assert files[:8] == [f"demo_msgs_count_{part}_pkg" for part in parts.split()]
    assert len(files) == 3 * 8


def test_a_service_that_a_message_hides_is_named_in_full(demo: Path) -> None:
    (demo / "demo_msgs" / "msg" / "Add.msg").write_text("uint8 value\n")
    assert len(load(request(demo, message="demo_msgs/Add", ros=2)).generate().files) == 3
    assert len(load(request(demo, message="demo_msgs/srv/Add", ros=2)).generate().files) == 6


# --- the configuration file --------------------------------------------------------------------------------------


def test_listing_5_1_is_read_as_it_stands(tmp_path: Path) -> None:
    path = tmp_path / "sobel.yaml"
    path.write_text(LISTING_5_1)
    order = order_of_config(path, libraries((), None, None))
    (image,) = order.messages
    assert (order.title, order.width, order.files) == ("Sobel Filter", 8, (path,))
    assert (str(image.message), image.ros.number) == ("sensor_msgs/Image", 1)
    assert image.interfaces == {"subscriber": ("AXIS2Image",), "publisher": ("Image2AXIS",)}


def test_every_name_is_an_entity_and_every_converter_comes_once(demo: Path) -> None:
    config = {
        "project": {"name": "Robot Arm", "width": 32},
        "messages": [
            {"type": "ROS2", "name": "demo_msgs/Grip", "subscribers": ["AXIS2Left", "AXIS2Right"]},
            {"type": "ROS", "name": "geometry_msgs/Twist", "publishers": ["Twist2AXIS"]},
            {"type": "ROS2", "name": "demo_msgs/Grip", "publishers": "Grip2AXIS"},
        ],
    }
    core = made(demo, yaml.safe_dump(config))
    assert core.description == "Converters of Robot Arm"
    assert stems(core) == [
        "demo_msgs_grip_pkg",
        "geometry_msgs_twist_pkg",
        "axis_to_demo_msgs_grip",
        "demo_msgs_grip_to_axis",
        "geometry_msgs_twist_to_axis",
        "AXIS2Left",
        "AXIS2Right",
        "Grip2AXIS",
        "Twist2AXIS",
    ]
    assert [*load(request(demo, config="robot.yaml")).inputs] == [
        demo / "robot.yaml",
        demo / "." / "demo_msgs" / "msg" / "Grip.msg",
    ]
    text = str(core.files["AXIS2Left.vhd"].content)
    assert "u_converter : entity work.axis_to_demo_msgs_grip\n" in text
    assert len(text.splitlines()) < 80


def test_golden_files_of_interfaces(demo: Path) -> None:
    entry = "{type: ROS, name: geometry_msgs/Point, subscribers: AXIS2Point, publishers: Point2AXIS}"
    core = made(demo, f"project: {{name: golden}}\nmessages: [{entry}]\n")
    for name in ("AXIS2Point.vhd", "Point2AXIS.vhd"):
        check_expected(GOLDEN / f"ros1_{name}", str(core.files[name].content))


def test_a_converter_may_be_called_by_its_own_name(demo: Path) -> None:
    entry = "{type: ROS, name: geometry_msgs/Point, subscribers: [axis_to_geometry_msgs_point, AXIS2Point]}"
    core = made(demo, f"project: {{name: own}}\nmessages: [{entry}]\n")
    assert stems(core) == ["geometry_msgs_point_pkg", "axis_to_geometry_msgs_point", "AXIS2Point"]


def test_a_message_in_both_versions_one_each_way(demo: Path) -> None:
    one = "{type: ROS, name: geometry_msgs/Point, subscribers: In}"
    two = "{type: ROS2, name: geometry_msgs/Point, publishers: [Out_2]}"
    core = made(demo, f"project: {{name: bridge}}\nmessages: [{one.replace('In', 'In_1')}, {two}]\n")
    assert stems(core)[:2] == ["geometry_msgs_point_ros1_pkg", "geometry_msgs_point_ros2_pkg"]
    assert stems(core)[4:] == ["In_1", "Out_2"]


def test_packages_are_namespaces(demo: Path) -> None:
    """Messages of the same name in two packages coexist."""
    (demo / "other_msgs" / "msg").mkdir(parents=True)
    (demo / "other_msgs" / "msg" / "Grip.msg").write_text("uint64 width\n")
    entries = [
        {"type": "ROS", "name": f"{package}/Grip", "subscribers": f"AXIS2{package[:4]}"}
        for package in ("demo_msgs", "other_msgs")
    ]
    core = made(demo, yaml.safe_dump({"project": {"name": "two"}, "messages": entries}))
    assert " closed " in str(core.files["axis_to_demo_msgs_grip.vhd"].content)
    assert "width            : out std_logic_vector(63 downto 0)" in str(
        core.files["axis_to_other_msgs_grip.vhd"].content
    )


def test_a_file_that_is_not_there(demo: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read .*robot\.yaml: No such file"):
        [*load(request(demo, config="robot.yaml")).inputs]


def test_a_port_called_like_the_instance(tmp_path: Path) -> None:
    ports = "    clk         : in  std_logic;\n    u_converter : out std_logic\n"
    vhdl = f"\nentity x is\n  port (\n{ports}  );\nend entity;\n"
    assert interface_configuration("y", "x", vhdl, "m")["label"] == "u_converter_2"


# --- a name for the units of a core -------------------------------------------------------------------------------


def test_every_unit_of_a_core_follows_its_name(demo: Path) -> None:
    core = load(request(demo, message="demo_msgs/srv/Add", ros=2, name="left")).generate()
    assert stems(core) == [
        "left_demo_msgs_add_request_pkg",
        "left_demo_msgs_add_response_pkg",
        "left_axis_to_demo_msgs_add_request",
        "left_demo_msgs_add_request_to_axis",
        "left_axis_to_demo_msgs_add_response",
        "left_demo_msgs_add_response_to_axis",
    ]
    for stem in stems(core):
        units = re.findall(
            r"^(?:entity|package|architecture \w+ of) (\w+)", str(core.files[f"{stem}.vhd"].content), re.MULTILINE
        )
        assert set(units) == {stem}


def test_the_units_of_a_configuration_follow_its_prefix_but_for_the_interfaces(demo: Path) -> None:
    messages = [
        {"type": ros, "name": "demo_msgs/Grip", way: [f"{ros}Grip"]}
        for ros, way in (("ROS1", "subscribers"), ("ROS2", "publishers"))
    ]
    core = made(demo, yaml.safe_dump({"project": {"name": "two", "prefix": "left"}, "messages": messages}))
    assert stems(core) == [
        "left_demo_msgs_grip_ros1_pkg",
        "left_demo_msgs_grip_ros2_pkg",
        "left_axis_to_demo_msgs_grip",
        "left_demo_msgs_grip_to_axis",
        "ROS1Grip",
        "ROS2Grip",
    ]
    assert "entity work.left_axis_to_demo_msgs_grip" in str(core.files["ROS1Grip.vhd"].content)
