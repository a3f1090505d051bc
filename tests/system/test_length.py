"""The sources of payload lengths: the choice of the analysis, its reasons, and the configuration of the top level."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.core.request import GeneratedCore, Request
from fusesoc_firm.system import system_core
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.configuration import system_configuration
from fusesoc_firm.system.views.show import derived_description
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import converter, derived, instance, messages, specification

IMAGE, CLOUD, TEXT = "sensor_msgs/Image", "sensor_msgs/PointCloud2", "std_msgs/String"
# Bounded, but its length is not computed.
BOUNDED = "demo_msgs/Tags"


def accelerator(name: str, taken: str, given: str, length: str = "") -> str:
    """A line of `accelerators` of ROS 2; `length` is added to its output."""
    sides = [f"{{middleware: ROS2, message: {taken}}}", f"{{middleware: ROS2, message: {given}{length}}}"]
    interface = f"{{input: [{sides[0]}], output: [{sides[1]}]}}"
    return f"  - {{name: {name}, type: VHDL, sources: acc.vhd, interface: {interface}}}\n"


def through(folder: Path, taken: str, given: str, length: str = "", buffer: str = "") -> DerivedSystem:
    """The system of one accelerator."""
    blocks = (
        converter("sub", "subscriber", taken, "acc", ros="ROS2")
        + instance("acc", "filter", "pub")
        + converter("pub", "publisher", given, ros="ROS2").replace("}\n", f"{buffer}}}\n")
    )
    return derived(folder, specification(blocks, accelerator("filter", taken, given, length)))


def generated(folder: Path) -> GeneratedCore:
    parameters = {"spec": "spec.yaml", "paths": None, "distro": None}
    return system_core.system_core(system_core.load_requested(Request("far", "a:b:c-d:0", folder, parameters)))


def described(system: DerivedSystem) -> dict[str, Any]:
    (publisher,) = derived_description(system)["Converters"]["msg_to_AXIS"]
    return {key: publisher[key] for key in ("length", "because", "buffer", "payloadBytes") if key in publisher}


@pytest.mark.parametrize(
    ("message", "length", "buffer", "expected"),
    [
        (
            IMAGE,
            "",
            "",
            {
                "length": "computed",
                "because": "the lengths at the output's ports determine the payload's length",
                "payloadBytes": "44 or more",
            },
        ),
        (
            IMAGE,
            ", length: given",
            "",
            {"length": "given", "because": "the specification selects this source", "payloadBytes": "44 or more"},
        ),
        (
            IMAGE,
            ", length: buffered",
            ", buffer: 5000",
            {
                "length": "buffered",
                "because": "the specification selects this source",
                "buffer": 5000,
                "payloadBytes": "44 or more",
            },
        ),
        (
            CLOUD,
            "",
            ", buffer: 9000",
            {
                "length": "buffered",
                "because": "each element of 'fields' has a separate length, 'fields.name'",
                "buffer": 9000,
                "payloadBytes": "49 or more",
            },
        ),
        ("geometry_msgs/Point", "", "", {"payloadBytes": 28}),
    ],
)
def test_what_is_chosen_is_shown(
    tmp_path: Path, message: str, length: str, buffer: str, expected: dict[str, Any]
) -> None:
    assert described(through(tmp_path, message, message, length, buffer)) == expected


def test_a_subscriber_has_the_length(tmp_path: Path) -> None:
    blocks = converter("s", "subscriber", CLOUD, "p") + converter("p", "publisher", CLOUD)
    system = derived(tmp_path, specification(blocks))
    assert described(system) == {
        "length": "given",
        "because": "the subscriber has the length",
        "payloadBytes": described(system)["payloadBytes"],
    }


def test_ports_and_what_stands_between_them(tmp_path: Path) -> None:
    """The accelerator has a port for the length only where it gives it; elsewhere the signal comes from somewhere."""
    ports, drivers = {}, {}
    for length, buffer in (("computed", ""), ("given", ""), ("buffered", ", buffer: 100")):
        found = system_configuration(through(tmp_path, IMAGE, IMAGE, f", length: {length}", buffer))
        formals = [item["formal"].strip() for item in found["accelerators"][0]["ports"]]
        assert "in_payload_length" in formals
        ports[length] = "out_payload_length" in formals
        (connection,) = (item for item in found["connections"] if item["source"] == "acc")
        assigned = {item["target"].strip(): item["source"] for item in connection["assignments"]}
        driver = assigned["pub_payload_length"]
        drivers[length] = (driver, connection["length"] is not None, assigned.get(driver))
        buffer_of = found["publishers"][0]["buffer"]
        assert (buffer_of is not None) == (length == "buffered")
        assert found["error_count"] == 2
        assert found["publisher_errors"] == [{"bit": 1, "block": "pub"}]
    assert ports == {"computed": False, "given": True, "buffered": False}
    assert drivers == {
        "computed": ("acc_out_sent_length", True, None),
        "given": ("acc_out_payload_length", False, None),
        "buffered": ("acc_out_sent_length", False, 'x"FFFFFFFF"'),
    }


def generics_of(instance: dict[str, Any]) -> dict[str, str]:
    """The generics of an instance in the top level."""
    return {item["formal"]: item["actual"] for item in instance["generics"]}


@pytest.mark.parametrize(("width", "depth"), [(8, 105), (64, 14), (512, 2)])
def test_a_buffer_is_as_deep_as_its_longest_frame(tmp_path: Path, width: int, depth: int) -> None:
    blocks = converter("s", "subscriber", IMAGE, "p") + converter("p", "publisher", IMAGE).replace(
        "}\n", ", buffer: 100}\n"
    )
    found = system_configuration(derived(tmp_path, specification(blocks, project=f"{{name: a, width: {width}}}")))
    assert generics_of(found["publishers"][0]["buffer"]["instance"])["DEPTH"] == str(depth)


def test_the_length_entity_is_a_file_of_the_core(tmp_path: Path) -> None:
    through(tmp_path, IMAGE, IMAGE)
    core = system_core.system_core(
        system_core.load_requested(
            Request("far", "a:b:c-d:0", tmp_path, {"spec": "spec.yaml", "paths": None, "distro": None})
        )
    )
    assert "sensor_msgs_image_length.vhd" in core.files
    through(tmp_path, IMAGE, IMAGE, ", length: given")
    core = system_core.system_core(
        system_core.load_requested(
            Request("far", "a:b:c-d:0", tmp_path, {"spec": "spec.yaml", "paths": None, "distro": None})
        )
    )
    assert "sensor_msgs_image_length.vhd" not in core.files


def test_no_accelerator_is_called_like_a_length_entity(tmp_path: Path) -> None:
    blocks = (
        converter("sub", "subscriber", IMAGE, "acc", ros="ROS2")
        + instance("acc", "sensor_msgs_image_length", "pub")
        + converter("pub", "publisher", IMAGE, ros="ROS2")
    )
    with pytest.raises(InputError) as raised:
        derived(tmp_path, specification(blocks, accelerator("sensor_msgs_image_length", IMAGE, IMAGE)))
    (message,) = messages(raised.value)
    assert "and the unit that computes the length of sensor_msgs/Image both need the entity" in message


FORKS = (
    converter("s", "subscriber", CLOUD, "p", "acc", ros="ROS2")
    + instance("acc", "same", "q", "r")
    + "".join(converter(name, "publisher", CLOUD, ros="ROS2").replace("}\n", ", buffer: 99}\n") for name in "pqr")
)


def test_every_handshake_of_a_fork_is_forked(tmp_path: Path) -> None:
    system = derived(tmp_path, specification(FORKS, accelerator("same", CLOUD, CLOUD, ", length: given")))
    found = system_configuration(system)
    for connection in found["connections"]:
        assert [fork["label"].rpartition("_fork")[0] for fork in connection["forks"]] == [
            f"u_{connection['source']}{'_out' if connection['source'] == 'acc' else ''}{part}"
            for part in ("", "_header_frame_id_axis", "_fields", "_fields_name_axis", "_data_axis")
        ]
        targets = Counter(item["target"].strip() for item in connection["assignments"])
        assert set(targets.values()) == {1}
    message, _, element, *_ = map(generics_of, found["connections"][0]["forks"])
    assert (message, element) == ({"SINKS": "2", "SEGMENTS": "4"}, {"SINKS": "2", "SEGMENTS": "2"})


def test_publishers_that_wait_for_one_stream_need_buffers(tmp_path: Path) -> None:
    with pytest.raises(InputError) as raised:
        derived(
            tmp_path,
            specification(FORKS.replace(", buffer: 99", ""), accelerator("same", CLOUD, CLOUD, ", length: given")),
        )
    reason = "'p', 'q', 'r' wait for the same streams, but only one of them can send at a time"
    assert messages(raised.value) == [f"'{name}' needs a 'buffer': {reason}" for name in "pqr"]


def test_what_ends_in_messages_of_fixed_size_needs_no_buffer(tmp_path: Path) -> None:
    """A frame of fixed size is sent in one go when all of it is there."""
    blocks = (
        converter("s", "subscriber", IMAGE, "p", "acc", ros="ROS2")
        + instance("acc", "mean", "q")
        + converter("p", "publisher", IMAGE, ros="ROS2")
        + converter("q", "publisher", "Point", ros="ROS2")
    )
    system = derived(tmp_path, specification(blocks, accelerator("mean", IMAGE, "geometry_msgs/Point")))
    assert [item.buffer for item in system.publishers] == [0, 0]
    assert system.error_blocks == ("s", "p")


def test_a_bounded_message_has_its_buffer(tmp_path: Path) -> None:
    package = tmp_path / "demo_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "msg" / "Tags.msg").write_text("string<=10[<=4] tags\n", encoding="utf-8")
    derived_text = specification(
        converter("sub", "subscriber", "std_msgs/UInt8", "acc", ros="ROS2")
        + instance("acc", "filter", "pub")
        + converter("pub", "publisher", BOUNDED, ros="ROS2"),
        accelerator("filter", "std_msgs/UInt8", BOUNDED),
    )
    (tmp_path / "spec.yaml").write_text(derived_text, encoding="utf-8")
    (tmp_path / "acc.vhd").touch()
    request = Request("far", "a:b:c-d:0", tmp_path, {"spec": "spec.yaml", "paths": ["."], "distro": None})
    system = system_core.load_requested(request).system
    # CDR's header, the count, three texts of 15 bytes with padding, one without.
    assert system.publishers[0].buffer == 4 + 4 + 3 * 16 + 15


# --- parts of messages -----------------------------------------------------------------------------------------------


def test_a_subscriber_without_all_parts_does_not_have_the_length(tmp_path: Path) -> None:
    def length(fields: str, buffer: str = "") -> dict[str, Any]:
        publisher = converter("p", "publisher", IMAGE).replace("}\n", f"{buffer}}}\n")
        blocks = converter("s", "subscriber", IMAGE, "p").replace("{name: p}", f"{{name: p, {fields}}}") + publisher
        return described(derived(tmp_path, specification(blocks)))

    assert length("exclude: [height, header.stamp]")["length"] == "given"
    assert length("include: height")["length"] == "computed"
    found = length("exclude: data", ", buffer: 100")
    assert found["length"] == "buffered"
    assert found["because"] == "the subscriber's length includes 'data', which no block uses"


def test_parts_of_two_outputs_have_two_entities(tmp_path: Path) -> None:
    blocks = (
        converter("s", "subscriber", "geometry_msgs/Point", "a", "b", ros="ROS2")
        + instance("a", "one", "p")
        + instance("b", "two", "q")
        + "".join(converter(name, "publisher", IMAGE, ros="ROS2") for name in "pq")
    )
    types = accelerator("one", "geometry_msgs/Point", IMAGE) + accelerator(
        "two", "geometry_msgs/Point", IMAGE, ", exclude: [data]"
    )
    derived(tmp_path, specification(blocks, types))
    core = generated(tmp_path)
    assert {name for name in core.files if "_length" in name} == {
        "sensor_msgs_image_length.vhd",
        "sensor_msgs_image_length_b.vhd",
    }
    assert "data_length" not in str(core.files["sensor_msgs_image_length_b.vhd"].content)
