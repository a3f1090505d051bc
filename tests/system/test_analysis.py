"""From specification to derived system: ids, names, and which port each connection means."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.core.request import Request
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.system.system_core import load_requested, load_system
from fusesoc_firm.system.written.specification import Specification
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import (
    LIBRARIES,
    accelerator,
    connections,
    converter,
    derived,
    instance,
    messages,
    read,
    specification,
)

LISTING = Path(__file__).resolve().parents[2] / "specs" / "quat2euler" / "quat2euler_hls.yaml"


def test_listing_6_1_of_the_dissertation() -> None:
    """As it stands there: three spellings of its own, keys without a value, comments."""
    loaded = load_system(LISTING, LIBRARIES)
    system = loaded.system
    assert (system.entity, system.fpga_part) == ("quaterniontoeuler_system", "xc7z020clg400-1")
    assert [(item.block, str(item.frame.message), item.id) for item in system.subscribers] == [
        ("QuaternionToEuler_sub", "geometry_msgs/Quaternion", 0)
    ]
    assert [(item.block, str(item.frame.message), item.id) for item in system.publishers] == [
        ("QuaternionToEuler_pub", "geometry_msgs/Point", 0)
    ]
    (block,) = system.accelerators
    assert (block.block, block.type.accelerator.type) == ("QuaternionToEulerConverter", "HLS")
    assert connections(system) == [
        "QuaternionToEuler_sub. -> QuaternionToEulerConverter.in_",
        "QuaternionToEulerConverter.out_ -> QuaternionToEuler_pub.",
    ]
    assert loaded.inputs() == [LISTING.parent / "QuaternionToEuler.cpp"]
    text = LISTING.read_text(encoding="utf-8")
    assert "fpgaPartpart" in text and "    type:    " in text


def test_ids_count_apart_in_the_order_of_the_blocks(tmp_path: Path) -> None:
    blocks = (
        converter("p1", "publisher", "Pose")
        + converter("s0", "subscriber", "Point", "p0")
        + converter("p0", "publisher", "Point")
        + converter("s1", "subscriber", "Pose", "p1")
    )
    system = derived(tmp_path, specification(blocks))
    assert [(item.block, item.id) for item in system.subscribers] == [("s0", 0), ("s1", 1)]
    assert [(item.block, item.id) for item in system.publishers] == [("p1", 0), ("p0", 1)]
    assert [str(frame.message) for frame in system.frames] == ["geometry_msgs/Point", "geometry_msgs/Pose"]


@pytest.mark.parametrize("ros", ["ROS", "ROS1", "ROS2"])
def test_the_version_of_ros(tmp_path: Path, ros: str) -> None:
    blocks = converter("s", "subscriber", "geometry_msgs/msg/Point", "p", ros=ros) + converter(
        "p", "publisher", "geometry_msgs/Point", ros=ros
    )
    (subscriber,) = derived(tmp_path, specification(blocks)).subscribers
    assert subscriber.frame.ros is (ROS2 if ros == "ROS2" else ROS1)


def test_accelerators_in_a_row_and_one_type_used_twice(tmp_path: Path) -> None:
    blocks = (
        converter("s", "subscriber", "Point", "a")
        + instance("a", "same", "b")
        + instance("b", "same", "p")
        + converter("p", "publisher", "Point")
    )
    system = derived(tmp_path, specification(blocks, accelerator("same", "Point", "Point")))
    assert connections(system) == ["s. -> a.in_", "a.out_ -> b.in_", "b.out_ -> p."]
    assert [block.block for block in system.accelerators] == ["a", "b"]
    assert len(system.accelerator_types) == 1


def test_one_output_for_many(tmp_path: Path) -> None:
    blocks = (
        converter("s", "subscriber", "Point", "p", "a", "q")
        + instance("a", "same", "r")
        + "".join(converter(name, "publisher", "Point") for name in "pqr")
    )
    system = derived(tmp_path, specification(blocks, accelerator("same", "Point", "Point")))
    assert connections(system) == ["s. -> p., a.in_, q.", "a.out_ -> r."]


def test_inputs_and_outputs_of_one_type_are_taken_in_turn(tmp_path: Path) -> None:
    blocks = (
        converter("s", "subscriber", "Point", "a")
        + converter("t", "subscriber", "Point", "a")
        + instance("a", "two", "p", "q", "r")
        + "".join(converter(name, "publisher", "Point") for name in "pqr")
    )
    system = derived(tmp_path, specification(blocks, accelerator("two", "Point Point", "Point Point")))
    assert connections(system) == ["s. -> a.in0_", "t. -> a.in1_", "a.out0_ -> p.", "a.out1_ -> q., r."]


def test_several_messages_between_two_blocks(tmp_path: Path) -> None:
    blocks = (
        converter("s", "subscriber", "Point", "a")
        + instance("a", "split", "b", "b")
        + instance("b", "unite", "p")
        + converter("p", "publisher", "Point")
    )
    types = accelerator("split", "Point", "Vector3 Pose") + accelerator("unite", "Pose Vector3", "Point")
    system = derived(tmp_path, specification(blocks, types))
    assert connections(system) == ["s. -> a.in_", "a.out0_ -> b.in1_", "a.out1_ -> b.in0_", "b.out_ -> p."]


def test_source_and_sink_may_be_accelerators(tmp_path: Path) -> None:
    """One that gives without taking, and one that takes without giving."""
    blocks = (
        instance("clock", "tick", "p")
        + converter("p", "publisher", "Point")
        + converter("s", "subscriber", "Pose", "end")
        + instance("end", "drain")
    )
    types = accelerator("tick", "", "Point") + accelerator("drain", "Pose", "")
    assert connections(derived(tmp_path, specification(blocks, types))) == ["clock.out_ -> p.", "s. -> end.in_"]


@pytest.mark.parametrize(
    ("name", "entity"),
    [("Arm", "arm_system"), ("left arm", "left_arm_system"), ("2nd", "n2nd_system"), ("signal", "signal_field_system")],
)
def test_the_name_of_the_top_level(tmp_path: Path, name: str, entity: str) -> None:
    blocks = converter("s", "subscriber", "Point", "p") + converter("p", "publisher", "Point")
    assert derived(tmp_path, specification(blocks, project=f"{{name: {name}}}")).entity == entity


@pytest.mark.parametrize(("count", "message"), [(256, ""), (257, "the system has 257 subscribers")])
def test_an_id_is_one_byte(tmp_path: Path, count: int, message: str) -> None:
    types = accelerator("drain", "Point", "") + accelerator("tick", "", "Point")
    blocks = "".join(
        converter(f"s{number}", "subscriber", "Point", f"e{number}") + instance(f"e{number}", "drain")
        for number in range(count)
    )
    text = specification(blocks + instance("t", "tick", "p") + converter("p", "publisher", "Point"), types)
    if not message:
        assert len(derived(tmp_path, text).subscribers) == count
        return
    with pytest.raises(InputError, match=message):
        derived(tmp_path, text)


def test_faults_that_only_follow_are_not_reported(tmp_path: Path) -> None:
    """One word is wrong, and everything downstream depends on it."""
    blocks = (
        converter("s", "subscriber", "Point", "a")
        + instance("a", "same", "b")
        + instance("b", "same", "p")
        + converter("p", "publisher", "Point")
    )
    right = specification(blocks, accelerator("same", "Point", "Point"))
    for old, new, message in (
        ("message: geometry_msgs/Point}]", "message: geometry_msgs/Pint}]", "unknown message 'geometry_msgs/Pint'"),
        ("mode: publisher", "mode: publish", "'mode' cannot be 'publish'"),
        (
            "type: same, outgoing: [{name: b}]",
            "typ: same, outgoing: [{name: b}]",
            "an item of 'blocks' has no key 'typ'",
        ),
        ("[{name: b}]", "[{name: c}]", "unknown block 'c'"),
        ("{name: b,", "{nam: b,", "an item of 'blocks' has no key 'nam'"),
        ("interface: ", "interfaces: ", "an item of 'accelerators' has no key 'interfaces'"),
        ("{name: a, type: same", "{name: a, type: sama", "unknown accelerator 'sama'"),
    ):
        assert old in right
        with pytest.raises(InputError) as raised:
            derived(tmp_path, right.replace(old, new, 1))
        assert messages(raised.value) == [message]


def test_what_is_wrong_beside_an_unreadable_block_is_reported(tmp_path: Path) -> None:
    blocks = (
        converter("s", "subscriber", "Point", "p")
        + converter("p", "publish", "Point")
        + converter("t", "subscriber", "Pose", "q")
        + converter("q", "publisher", "Vector3")
        + converter("u", "subscriber", "Pose")
    )
    with pytest.raises(InputError) as raised:
        derived(tmp_path, specification(blocks))
    assert [message.partition("(")[0] for message in messages(raised.value)] == [
        "'mode' cannot be 'publish'",
        "'t' outputs geometry_msgs/Pose ",
        "the output of 'u' ",
    ]


def test_the_specification_is_kept_as_it_was_written(tmp_path: Path) -> None:
    found, _ = read(tmp_path, LISTING.read_text(encoding="utf-8"))
    assert isinstance(found, Specification)
    assert found.accelerators[0].sources == ("./QuaternionToEuler.cpp",)
    assert str(found.blocks[2].name.source) == "spec.yaml:36:11"


@pytest.mark.parametrize("distro", [None, "noetic", "humble"])
def test_a_distribution_is_meant_for_its_own_version(tmp_path: Path, distro: str | None) -> None:
    blocks = "".join(
        converter(f"s{ros}", "subscriber", message, f"p{ros}", ros=ros)
        + converter(f"p{ros}", "publisher", message, ros=ros)
        for ros, message in (("ROS1", "Point"), ("ROS2", "Pose"))
    )
    read(tmp_path, specification(blocks))
    request = Request("far", "a:b:c-d:0", tmp_path, {"spec": "spec.yaml", "paths": None, "distro": distro})
    assert len(load_requested(request).system.publishers) == 2


def test_the_clock_of_a_board_is_that_of_its_pin(tmp_path: Path) -> None:
    """A call with another clock would give the times and the UART another frequency than the board has."""
    read(tmp_path, specification(converter("s", "subscriber", "Point", "p") + converter("p", "publisher", "Point")))
    for clock in (None, "12 MHz", "0.012 GHz"):
        parameters = {"spec": "spec.yaml", "paths": None, "board": "icebreaker", "clock": clock}
        loaded = load_requested(Request("far", "a:b:c-d:0", tmp_path, parameters))
        assert loaded.system.clock == 12_000_000
    with pytest.raises(InputError) as raised:
        load_requested(Request("far", "a:b:c-d:0", tmp_path, {**parameters, "clock": "400 MHz"}))
    assert str(raised.value) == (
        "error: clk of board 'icebreaker' has 12 MHz, not 400 MHz\n"
        "      = remove the parameter 'clock'; a pin or a PLL of the board sets it"
    )


def test_an_unknown_distribution(tmp_path: Path) -> None:
    read(tmp_path, specification(converter("s", "subscriber", "Point", "p") + converter("p", "publisher", "Point")))
    request = Request("far", "a:b:c-d:0", tmp_path, {"spec": "spec.yaml", "paths": None, "distro": "melodious"})
    with pytest.raises(InputError, match="unknown ROS distribution 'melodious'"):
        load_requested(request)
