"""Which gates stand between two converters; that they work is simulated."""

from __future__ import annotations

from fusesoc_firm.converter.message_ports import MessagePort
from fusesoc_firm.runs.verify.loop import gates


def stream(name: str) -> list[MessagePort]:
    return [
        MessagePort(f"{name}_length", 32),
        MessagePort(f"{name}_axis_tdata", 8),
        MessagePort(f"{name}_axis_tkeep", 1),
        MessagePort(f"{name}_axis_tvalid", None),
        MessagePort(f"{name}_axis_tlast", None),
        MessagePort(f"{name}_axis_tready", None, is_reverse=True),
    ]


def element(name: str, inner: list[MessagePort], segments: int = 0) -> list[MessagePort]:
    own = [MessagePort(f"{name}_segment_valid", segments)] if segments else []
    return [
        MessagePort(f"{name}_length", 32),
        *inner,
        *own,
        MessagePort(f"{name}_valid", None),
        MessagePort(f"{name}_last", None),
        MessagePort(f"{name}_ready", None, is_reverse=True),
    ]


def test_every_handshake_has_a_gate() -> None:
    # A field that is called as a handshake is none.
    ports = [MessagePort("door_ready", None), *stream("label"), *element("points", [MessagePort("points_x", 64)])]
    found = gates(ports, 2, has_msg_valid=True)
    assert [gate.name for gate in found] == [
        "segment_valid(0)",
        "segment_valid(1)",
        "label_axis_tvalid",
        "points_valid",
        "msg_valid",
    ]
    assert found[4].valid == "sub_msg_valid and pub_segment_valid(0) and pub_segment_valid(1)"
    assert found[1].ready == "msg_ready"
    assert found[2].assignments == (
        ("pub_label_axis_tvalid", "sub_label_axis_tvalid and is_open(2)"),
        ("sub_label_axis_tready", "pub_label_axis_tready and is_open(2)"),
    )


def test_an_element_is_shown_behind_its_segments() -> None:
    ports = element("points", [*stream("points_name"), MessagePort("points_x", 64)], segments=2)
    found = gates(ports, 1, has_msg_valid=False)
    names = ["segment_valid(0)", "points_name_axis_tvalid", "points_segment_valid(0)", "points_segment_valid(1)"]
    assert [gate.name for gate in found] == [*names, "points_valid"]
    assert found[2].ready == "pub_points_valid and pub_points_ready"
    shown = "pub_points_segment_valid(0) and pub_points_segment_valid(1)"
    assert found[4].valid == f"sub_points_valid and {shown}"
    assert found[4].assignments == (
        ("pub_points_valid", f"sub_points_valid and {shown} and is_open(4)"),
        ("sub_points_ready", f"pub_points_ready and {shown} and is_open(4)"),
    )
