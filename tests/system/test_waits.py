"""The wires that a live simulation watches: which there are, and the levels that show whether a message waits."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.system.hardware.configuration import SYSTEM_TEMPLATE, system_configuration
from fusesoc_firm.system.hardware.waits import FROM_HOST, HOST_WIRES, TO_HOST, Wire, waits_configuration, wires
from fusesoc_firm.text.render import Context, render
from tests.system.systems import converter, derived, signals, specification
from tests.system.test_configuration import AWKWARD, BLOCKS, TYPES

# Publishers that get the same message need a buffer.
_BUFFERED = converter("a", "publisher", "std_msgs/String") + converter("b", "publisher", "std_msgs/String")
STRINGS = (
    converter("Words", "subscriber", "std_msgs/String", "a", "b")
    + _BUFFERED.replace("outgoing: []", "buffer: 100")
    + converter("names", "subscriber", "sensor_msgs/JointState", "c")
    + converter("c", "publisher", "sensor_msgs/JointState")
)


def levels(found: Context, wire: Wire, language: str = "") -> list[tuple[str, str]]:
    (row,) = (item for item in found["wires"] if (item["source"], item["sink"]) == wire)
    return [(item[f"{language}valid"], item[f"{language}ready"]) for item in row["handshakes"]]


def test_wires_are_those_of_the_data_flow(tmp_path: Path) -> None:
    system = derived(tmp_path, specification(BLOCKS, TYPES))
    inner = [
        (FROM_HOST, "s"),
        (FROM_HOST, "s_2"),
        ("s", "p"),
        ("s", "acc"),
        ("s_2", "acc"),
        ("acc", "q"),
        ("acc", "r"),
        ("p", TO_HOST),
        ("q", TO_HOST),
        ("r", TO_HOST),
    ]
    assert wires(system) == [*HOST_WIRES, *inner]
    found = waits_configuration(system)
    assert [(row["bit"], row["source"], row["sink"]) for row in found["wires"]] == [
        (bit, *wire) for bit, wire in enumerate(inner)
    ]
    # The message of `s` has two sinks, each of which takes it in its own time.
    assert levels(found, ("s", "p")) == [("s_fork_valid(0)", "s_fork_ready(0)")]
    assert levels(found, ("s", "acc"), "verilog_") == [("s_fork_valid[1]", "s_fork_ready[1]")]
    assert levels(found, ("s_2", "acc")) == [("s_2_segment_valid(0)", "s_2_msg_ready")]
    # A vector of one bit has no index in a netlist.
    assert levels(found, ("s_2", "acc"), "verilog_") == [("s_2_segment_valid", "s_2_msg_ready")]
    assert levels(found, ("r", TO_HOST)) == [("pub_axis_tvalid(2)", "pub_axis_tready(2)")]


def test_messages_of_variable_size_wait_in_each_of_their_parts(tmp_path: Path) -> None:
    found = waits_configuration(derived(tmp_path, specification(STRINGS)))
    assert levels(found, ("Words", "b")) == [
        ("Words_fork_valid(1)", "Words_fork_ready(1)"),
        ("Words_data_axis_fork_valid(1)", "Words_data_axis_fork_ready(1)"),
    ]
    # GHDL's netlist has lower-case names.
    assert levels(found, ("Words", "a"), "verilog_")[0] == ("words_fork_valid[0]", "words_fork_ready[0]")
    own = [valid for valid, _ in levels(found, ("names", "c"))]
    assert {"names_msg_valid", "names_position_axis_tvalid", "names_name_valid"} <= {*own}


@pytest.mark.parametrize("blocks", [BLOCKS, AWKWARD, STRINGS])
def test_only_the_watched_top_level_shows_them(tmp_path: Path, blocks: str) -> None:
    system = derived(tmp_path, specification(blocks, "" if blocks == STRINGS else TYPES))
    plain = render(SYSTEM_TEMPLATE, system_configuration(system))
    watched = render(SYSTEM_TEMPLATE, system_configuration(system, is_watched=True))
    assert not re.search(r"\bwaits\b", plain)
    # What it adds are the port and its assignments.
    rest = [line.rstrip(";") for line in watched.replace("_system_watched", "_system").splitlines()]
    assert [line for line in plain.splitlines() if line.rstrip(";") not in rest] == []
    assert signals(plain) == signals(watched)
    known = {*signals(watched), "waits"}
    for text in re.findall(r"^  waits\(\d+\) <=\n((?:    .*\n)+)", watched, re.MULTILINE):
        assert {word for word in re.findall(r"\w+", text) if not word.isdecimal()} - {"and", "not", "or"} <= known
    assert len(re.findall(r"^  waits\(\d+\) <=$", watched, re.MULTILINE)) == len(wires(system)) - len(HOST_WIRES)
