"""Accelerators in software: what crosses to hardware and back, and what stays on the host."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.frame.select import names_in_use
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.derived.model import Connection, DerivedSystem, End
from fusesoc_firm.system.hardware.configuration import system_configuration
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.system.views.diagram import diagram
from fusesoc_firm.system.views.report import report
from fusesoc_firm.system.views.show import derived_description
from fusesoc_firm.text.diagnostics import InputError
from tests.seeds import seeded
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

SEED = seeded(20240801)
IMAGE = "sensor_msgs/Image"


def soft(name: str, inputs: str, outputs: str) -> str:
    """A line of `accelerators`: software that is elsewhere."""
    return accelerator(name, inputs, outputs, "ROS-SW").replace("sources: [acc.vhd], ", "")


def on_host(system: DerivedSystem) -> list[str]:
    """The connections of the host's part."""
    return ways(system.software.connections)


def ways(found: tuple[Connection, ...]) -> list[str]:
    """`block.prefix -> block.prefix, ...` of each connection."""
    return [
        f"{item.source.block}.{item.source.prefix} -> {', '.join(f'{end.block}.{end.prefix}' for end in item.sinks)}"
        for item in found
    ]


def converters(system: DerivedSystem) -> tuple[list[str], list[str]]:
    """The blocks of subscribers and publishers, in the order of their ids."""
    assert [item.id for item in system.subscribers] == [*range(len(system.subscribers))]
    assert [item.id for item in system.publishers] == [*range(len(system.publishers))]
    return [item.block for item in system.subscribers], [item.block for item in system.publishers]


def row(*types: str, message: str = "Point") -> str:
    """A subscriber `sub`, blocks `b0`, `b1`, ... of these types, and a publisher `pub`, connected in a row."""
    names = [f"b{number}" for number in range(len(types))]
    blocks = converter("sub", "subscriber", message, names[0])
    blocks += "".join(
        instance(name, kind, after) for name, kind, after in zip(names, types, [*names[1:], "pub"], strict=True)
    )
    return blocks + converter("pub", "publisher", message)


TYPES = soft("soft", "Point", "Point") + accelerator("hard", "Point", "Point")


@pytest.mark.parametrize(
    ("types", "hardware", "host", "subscribers", "publishers"),
    [
        (
            "hard soft hard",
            ["sub. -> b0.in_", "b0.out_ -> b1_in.", "b1_out. -> b2.in_", "b2.out_ -> pub."],
            ["b1_in. -> b1.in_", "b1.out_ -> b1_out."],
            ["sub", "b1_out"],
            ["pub", "b1_in"],
        ),
        (
            "soft hard soft",
            ["b0_out. -> b1.in_", "b1.out_ -> b2_in."],
            ["b2_in. -> b2.in_", "sub. -> b0.in_", "b0.out_ -> b0_out.", "b2.out_ -> pub."],
            ["b0_out"],
            ["b2_in"],
        ),
        (
            "hard soft soft hard",
            ["sub. -> b0.in_", "b0.out_ -> b1_in.", "b2_out. -> b3.in_", "b3.out_ -> pub."],
            ["b1_in. -> b1.in_", "b1.out_ -> b2.in_", "b2.out_ -> b2_out."],
            ["sub", "b2_out"],
            ["pub", "b1_in"],
        ),
        (
            "soft hard soft hard",
            ["b0_out. -> b1.in_", "b1.out_ -> b2_in.", "b2_out. -> b3.in_", "b3.out_ -> pub."],
            ["b2_in. -> b2.in_", "sub. -> b0.in_", "b0.out_ -> b0_out.", "b2.out_ -> b2_out."],
            ["b0_out", "b2_out"],
            ["pub", "b2_in"],
        ),
    ],
)
@pytest.mark.parametrize("message", ["Point", IMAGE])
def test_blocks_in_a_row(
    tmp_path: Path,
    types: str,
    hardware: list[str],
    host: list[str],
    subscribers: list[str],
    publishers: list[str],
    message: str,
) -> None:
    text = specification(
        row(*types.split(), message=message),
        TYPES.replace("geometry_msgs/Point", message) if message != "Point" else TYPES,
    )
    system = derived(tmp_path, text)
    assert connections(system) == hardware
    assert on_host(system) == host
    assert converters(system) == (subscribers, publishers)
    in_software = [f"b{number}" for number, kind in enumerate(types.split()) if kind == "soft"]
    assert [block.block for block in system.software.blocks] == in_software
    assert not {block.block for block in system.accelerators} & {*in_software}
    # The top level does not contain it.
    accelerators = {item["label"].removeprefix("u_") for item in system_configuration(system)["accelerators"]}
    assert accelerators.isdisjoint(in_software)


def test_who_a_converter_is_made_for(tmp_path: Path) -> None:
    system = derived(tmp_path, specification(row("hard", "soft", "hard"), TYPES))
    assert [item.software for item in system.subscribers] == [None, End("b1", "out_")]
    assert [item.software for item in system.publishers] == [None, End("b1", "in_")]


def test_a_message_for_hardware_and_software_goes_to_both(tmp_path: Path) -> None:
    blocks = (
        converter("sub", "subscriber", "Point", "h", "s", "copy")
        + instance("h", "hard", "p", "t", "u")
        + instance("s", "soft", "g", "q", "v")
        + instance("t", "soft", "r")
        + instance("u", "soft", "w")
        + instance("v", "soft", "x")
        + instance("g", "hard", "y")
        + "".join(converter(name, "publisher", "Point") for name in ("copy", *"pqrwxy"))
    )
    system = derived(tmp_path, specification(blocks, TYPES))
    assert connections(system) == [
        "sub. -> h.in_, copy.",
        "h.out_ -> p., t_in., u_in.",
        "s_out. -> g.in_",
        "g.out_ -> y.",
    ]
    assert on_host(system) == [
        "t_in. -> t.in_",
        "u_in. -> u.in_",
        "sub. -> s.in_",
        "s.out_ -> s_out., q., v.in_",
        "t.out_ -> r.",
        "u.out_ -> w.",
        "v.out_ -> x.",
    ]
    assert converters(system) == (["sub", "s_out"], ["copy", "p", "y", "t_in", "u_in"])
    assert [topic.block for topic in system.software.subscribers] == ["sub"]
    assert [topic.block for topic in system.software.publishers] == ["q", "r", "w", "x"]


def test_one_subscriber_for_all_that_take_an_output_in_hardware(tmp_path: Path) -> None:
    blocks = (
        converter("sub", "subscriber", "Point", "s")
        + instance("s", "soft", "a", "b")
        + instance("a", "hard", "p")
        + instance("b", "hard", "q")
        + converter("p", "publisher", "Point")
        + converter("q", "publisher", "Point")
    )
    system = derived(tmp_path, specification(blocks, TYPES))
    assert connections(system) == ["s_out. -> a.in_, b.in_", "a.out_ -> p.", "b.out_ -> q."]


def test_two_outputs_and_two_inputs_have_numbers(tmp_path: Path) -> None:
    types = soft("split", "Point Pose", "Vector3 Point") + accelerator("hard", "Point", "Point")
    blocks = (
        converter("sub", "subscriber", "Point", "h")
        + instance("h", "hard", "s")
        + converter("pose", "subscriber", "Pose", "s")
        + instance("s", "split", "p", "g")
        + instance("g", "hard", "q")
        + converter("p", "publisher", "Vector3")
        + converter("q", "publisher", "Point")
    )
    system = derived(tmp_path, specification(blocks, types))
    assert connections(system) == ["sub. -> h.in_", "h.out_ -> s_in0.", "s_out1. -> g.in_", "g.out_ -> q."]
    assert on_host(system) == ["s_in0. -> s.in0_", "pose. -> s.in1_", "s.out0_ -> p.", "s.out1_ -> s_out1."]


def test_a_type_is_used_twice(tmp_path: Path) -> None:
    system = derived(tmp_path, specification(row("hard", "soft", "hard", "soft"), TYPES))
    assert len(system.software.types) == 1
    assert converters(system) == (["sub", "b1_out"], ["b1_in", "b3_in"])


def test_no_name_is_taken_twice(tmp_path: Path) -> None:
    blocks = (
        converter("b_IN", "subscriber", "Point", "a")
        + instance("a", "hard", "b")
        + instance("b", "soft", "b_out")
        + instance("b_out", "hard", "b-out")
        + converter("b-out", "publisher", "Point")
    )
    system = derived(tmp_path, specification(blocks, TYPES).replace("b-out", "b_out_2"))
    assert converters(system) == (["b_IN", "b_out_3"], ["b_out_2", "b_in_2"])


# --- parts of messages ------------------------------------------------------------------------------------------------

PART = (
    "  - {{name: {name}, type: {kind}, {sources}interface: {{input: [{{middleware: ROS, message: geometry_msgs/Pose,"
    " include: [{field}]}}], output: [{{middleware: ROS, message: geometry_msgs/Pose, include: [{field}]}}]}}}}\n"
)


def parts_of_a_pose(tmp_path: Path, **kinds: str) -> DerivedSystem:
    """Position and orientation take ways of their own, the rest of nothing."""
    types = "".join(
        PART.format(name=field, kind=kind, sources="sources: acc.vhd, " if kind == "VHDL" else "", field=field)
        for field, kind in kinds.items()
    )
    blocks = (
        converter("sub", "subscriber", "Pose", "p", "o")
        + instance("p", "position", "pub")
        + instance("o", "orientation", "pub")
        + converter("pub", "publisher", "Pose")
        + converter("also", "subscriber", "Point", "echo")
        + converter("echo", "publisher", "Point")
    )
    return derived(tmp_path, specification(blocks, types))


def test_a_publisher_of_parts_is_hardware_if_one_comes_from_there(tmp_path: Path) -> None:
    system = parts_of_a_pose(tmp_path, position="ROS-SW", orientation="VHDL")
    assert connections(system) == ["sub. -> o.in_", "p_out. -> pub.", "o.out_ -> pub.", "also. -> echo."]
    assert on_host(system) == ["sub. -> p.in_", "p.out_ -> p_out."]
    sub, also, out = system.subscribers
    assert {names[0] for names in names_in_use(sub.frame)} == {"orientation"}
    assert {names[0] for names in names_in_use(out.frame)} == {"position"}
    assert out.suffix == "_p_out"
    assert also.suffix == ""


def test_a_publisher_of_parts_may_be_software(tmp_path: Path) -> None:
    system = parts_of_a_pose(tmp_path, position="ROS-SW", orientation="ROS-SW")
    assert connections(system) == ["also. -> echo."]
    assert on_host(system) == ["sub. -> p.in_, o.in_", "p.out_ -> pub.", "o.out_ -> pub."]
    assert [topic.block for topic in system.software.publishers] == ["pub"]
    assert [sorted({names[0] for names in names_in_use(frame)}) for frame in system.software.connections[0].frames] == [
        ["position"],
        ["orientation"],
    ]


def test_what_passes_by_software_stays_in_hardware(tmp_path: Path) -> None:
    """A part that a subscriber gives to a publisher itself is no accelerator's; the other part joins it there."""
    types = PART.format(name="lift", kind="ROS-SW", sources="", field="position")
    blocks = converter("sub", "subscriber", "Pose", "acc", "pub").replace(
        "{name: pub}", "{name: pub, exclude: [position]}"
    )
    blocks += instance("acc", "lift", "pub") + converter("pub", "publisher", "Pose")
    system = derived(tmp_path, specification(blocks, types))
    assert connections(system) == ["sub. -> pub.", "acc_out. -> pub."]
    assert on_host(system) == ["sub. -> acc.in_", "acc.out_ -> acc_out."]


def test_parts_meet_in_hardware_if_one_is_there(tmp_path: Path) -> None:
    types = PART.format(name="turn", kind="VHDL", sources="sources: acc.vhd, ", field="orientation")
    types += soft("soft", "Pose", "Pose")
    blocks = (
        converter("sub", "subscriber", "Pose", "s", "t").replace("{name: s}", "{name: s, include: [position]}")
        + instance("t", "turn", "s")
        + instance("s", "soft", "pub")
        + converter("pub", "publisher", "Pose")
    )
    system = derived(tmp_path, specification(blocks, types))
    assert connections(system) == ["sub. -> s_in., t.in_", "t.out_ -> s_in."]
    assert on_host(system) == ["s_in. -> s.in_", "s.out_ -> pub."]


# --- keys -------------------------------------------------------------------------------------------------------------


def test_a_publisher_for_software_has_the_keys_of_its_block(tmp_path: Path) -> None:
    types = accelerator("hard", IMAGE, IMAGE) + soft("soft", IMAGE, IMAGE)
    blocks = (
        converter("sub", "subscriber", IMAGE, "a")
        + instance("a", "hard", "s", "raw")
        + instance("s", "soft", "pub").replace("type: soft", "type: soft, buffer: 5000, period: 900, deadline: 700")
        + converter("raw", "publisher", IMAGE).replace("mode:", "buffer: 1000, period: 800, mode:")
        + converter("pub", "publisher", IMAGE).replace("mode:", "buffer: 1000, period: 800, mode:")
    )
    system = derived(tmp_path, specification(blocks, types, "{name: robot, scheduler: edf_latency}"))
    assert [(item.block, item.buffer) for item in system.publishers] == [("raw", 1000), ("s_in", 5000)]
    assert [(item.period, item.deadline) for item in system.scheduling.times] == [(800, 800), (900, 700)]


def test_a_buffer_is_for_what_has_no_fixed_size(tmp_path: Path) -> None:
    types = accelerator("hard", "Point", f"Point {IMAGE}") + soft("soft", f"Point {IMAGE}", "Point")
    blocks = (
        converter("sub", "subscriber", "Point", "a")
        + instance("a", "hard", "s", "s")
        + instance("s", "soft", "pub").replace("type: soft", "type: soft, buffer: 5000")
        + converter("pub", "publisher", "Point")
    )
    system = derived(tmp_path, specification(blocks, types))
    assert [(item.block, item.buffer) for item in system.publishers] == [("s_in0", 0), ("s_in1", 5000)]


def test_a_length_is_of_hardware_and_does_no_harm(tmp_path: Path) -> None:
    """What was hardware may have said where the length comes from; software's messages have theirs."""
    types = accelerator("hard", IMAGE, IMAGE) + soft("soft", IMAGE, IMAGE).replace(
        f"output: [{{middleware: ROS, message: {IMAGE}}}",
        f"output: [{{middleware: ROS, message: {IMAGE}, length: buffered}}",
    )
    assert "length: buffered" in types
    system = derived(tmp_path, specification(row("soft", "hard", message=IMAGE), types))
    (entering, _) = system.connections
    assert entering.length is not None
    assert (entering.source.block, entering.length.source.value) == ("b0_out", "given")


@pytest.mark.parametrize(("count", "fault"), [(256, ""), (257, "the hardware has 257 publishers")])
def test_an_id_is_one_byte(tmp_path: Path, count: int, fault: str) -> None:
    """Publishers whose messages come from software need no id."""
    blocks = converter("sub", "subscriber", "Point", *(f"a{number}" for number in range(count)))
    for number in range(count):
        blocks += instance(f"a{number}", "hard", f"s{number}") + instance(
            f"s{number}", "soft", f"p{number}", f"q{number}"
        )
        blocks += converter(f"p{number}", "publisher", "Point") + converter(f"q{number}", "publisher", "Point")
    if fault:
        with pytest.raises(InputError, match=fault):
            derived(tmp_path, specification(blocks, TYPES))
    else:
        assert len(derived(tmp_path, specification(blocks, TYPES)).publishers) == count


def test_faults_of_connections_are_those_of_hardware(tmp_path: Path) -> None:
    """Whatever an accelerator's type is, its messages come from somewhere; those of software do not meet others."""
    blocks = converter("sub", "subscriber", "Point", "a") + instance("a", "hard", "pub") + instance("s", "soft", "pub")
    for kind in (TYPES, TYPES.replace("ROS-SW", "VHDL, sources: acc.vhd")):
        with pytest.raises(InputError) as raised:
            derived(tmp_path, specification(blocks + converter("pub", "publisher", "Point"), kind))
        twice = ["'pub' already receives this message"] if kind == TYPES else []
        assert [message.partition(" (")[0] for message in messages(raised.value)] == ["input 'in_' of 's'", *twice]


# --- any system -------------------------------------------------------------------------------------------------------


def random_blocks(source: random.Random) -> str:
    """Blocks of one type, each fed by some of those before it or by a subscriber, and each read by somebody."""
    count = source.randint(1, 6)
    blocks = [f"b{number}" for number in range(count)]
    subscribers = [f"s{number}" for number in range(source.randint(1, 2))]
    outgoing: dict[str, list[str]] = {name: [] for name in (*subscribers, *blocks)}
    for number, block in enumerate(blocks):
        outgoing[source.choice([*subscribers, *blocks[:number]])].append(block)
    publishers: list[str] = []
    for ways_on in outgoing.values():
        if not ways_on or source.random() < 0.3:
            publishers.append(f"p{len(publishers)}")
            ways_on.append(publishers[-1])
        source.shuffle(ways_on)
    return (
        "".join(converter(name, "subscriber", "Point", *outgoing[name]) for name in subscribers)
        + "".join(instance(name, f"type_{name}", *outgoing[name]) for name in blocks)
        + "".join(converter(name, "publisher", "Point") for name in publishers)
    )


def all_ways(system: DerivedSystem) -> Iterator[tuple[End, End]]:
    """Every way from a block of the specification to another: a converter that is made for software is none."""
    sides = {item.block: item.software for item in (*system.subscribers, *system.publishers) if item.software}
    for connection in (*system.connections, *system.software.connections):
        for sink in connection.sinks:
            ends = (sides.get(connection.source.block, connection.source), sides.get(sink.block, sink))
            # Else it only leads to the converter of its own block.
            if ends[0] != ends[1]:
                yield ends


@pytest.mark.parametrize("number", range(25))
def test_a_word_moves_an_accelerator_and_no_message_takes_another_way(tmp_path: Path, number: int) -> None:
    print(f"seed {SEED + number}")
    source = random.Random(SEED + number)
    blocks = random_blocks(source)
    names = [f"b{position}" for position in range(blocks.count("type: type_"))]
    software = {name for name in names if source.random() < 0.5} - {source.choice(names)}

    def types(moved: set[str]) -> str:
        return "".join((soft if name in moved else accelerator)(f"type_{name}", "Point", "Point") for name in names)

    hardware = derived(tmp_path, specification(blocks, types(set())))
    parted = derived(tmp_path, specification(blocks, types(software)))
    assert sorted(all_ways(parted), key=str) == sorted(all_ways(hardware), key=str)
    assert not hardware.software.blocks and not hardware.software.connections
    # Hardware knows its own blocks only, and so does the host.
    inside = {item.block for item in (*parted.subscribers, *parted.publishers)}
    inside |= {item.block for item in parted.accelerators}
    ends = [end.block for item in parted.connections for end in (item.source, *item.sinks)]
    assert set(ends) == inside and inside.isdisjoint(software)
    outside = {end.block for item in parted.software.connections for end in (item.source, *item.sinks)}
    assert outside.isdisjoint(set(names) - software)


def test_sources_and_messages_of_software_are_inputs(tmp_path: Path) -> None:
    """Generated files are regenerated when one of them changes."""
    definition = tmp_path / "own_msgs" / "msg" / "Own.msg"
    definition.parent.mkdir(parents=True)
    definition.write_text("float64 x\n", encoding="utf-8")
    (tmp_path / "own_msgs" / "package.xml").write_text("<package><name>own_msgs</name></package>\n", encoding="utf-8")
    (tmp_path / "node.py").write_text("def node(message):\n    return message\n", encoding="utf-8")
    types = accelerator("node", "own_msgs/Own", "own_msgs/Own", "ROS-SW", "node.py")
    blocks = (
        converter("sub", "subscriber", "own_msgs/Own", "n")
        + instance("n", "node", "pub")
        + converter("pub", "publisher", "own_msgs/Own")
        + converter("in", "subscriber", "Point", "out")
        + converter("out", "publisher", "Point")
    )
    path = tmp_path / "spec.yaml"
    path.write_text(specification(blocks, types), encoding="utf-8")
    libraries = {ros: MessageLibrary(ros, [tmp_path / "own_msgs"]) for ros in (ROS1, ROS2)}
    assert load_system(path, libraries).inputs() == [tmp_path / "node.py", definition]


# --- what is shown ----------------------------------------------------------------------------------------------------


def test_the_derived_system_lists_software(tmp_path: Path) -> None:
    (tmp_path / "node.py").write_text("def soft(message):\n    return message\n", encoding="utf-8")
    types = accelerator("soft", "Point", "Point", "ROS-SW", "node.py") + accelerator("hard", "Point", "Point")
    shown = derived_description(derived(tmp_path, specification(row("hard", "soft", "soft", "hard"), types)))
    first, second = shown["Software"]
    point = {"nameMW": "geometry_msgs/Point", "ROS": 1}
    assert first == {
        "name": "b1",
        "type": "ROS-SW",
        "function": "soft",
        "sources": ["node.py"],
        "inputs": [{"name": "b1_in", **point, "from": [{"converter": "b1_in", "id": 1}]}],
        "outputs": [{"name": "b1_out", **point, "to": [{"block": "b2", "message": "b2_in"}]}],
    }
    assert second["inputs"][0]["from"] == [{"block": "b1", "message": "b1_out"}]
    assert second["outputs"][0]["to"] == [{"converter": "b2_out", "id": 1}]
    found = [item for group in shown["Converters"].values() for item in group if "software" in item]
    assert [(item["block"], item["software"], item["id"]) for item in found] == [
        ("b2_out", "b2", 1),
        ("b1_in", "b1", 1),
    ]
    assert [item["name"] for item in shown["Accelerators"]] == ["b0", "b3"]


def test_topics_are_shown_and_software_elsewhere_has_no_function(tmp_path: Path) -> None:
    shown = derived_description(derived(tmp_path, specification(row("soft", "hard", "soft"), TYPES)))
    first, second = shown["Software"]
    assert "function" not in first and "sources" not in first
    assert first["inputs"][0]["from"] == [{"topic": "sub"}]
    assert second["outputs"][0]["to"] == [{"topic": "pub"}]


def test_without_software_nothing_is_shown_of_it(tmp_path: Path) -> None:
    system = derived(tmp_path, specification(row("hard"), TYPES))
    assert "Software" not in derived_description(system)


def test_the_diagram_has_software_outside_of_the_fpga(tmp_path: Path) -> None:
    system = derived(tmp_path, specification(row("soft", "hard", "soft"), TYPES))
    text = diagram(system).replace("\\n", "\n")
    fpga = text[text.index("subgraph cluster_fpga") : text.index("\t}")]
    for block in ("b1", "b0_out", "b2_in"):
        assert f'"block {block}" [' in fpga
    for block in ("b0", "b2"):
        assert f'"block {block}" [' not in fpga and f'"block {block}" [' in text
    edges = ["host_out -> ", '"block b0" -> manager_in', 'manager_out -> "block b2"', '"block b2" -> host_in']
    for edge in (edges[0] + '"block b0"', *edges[1:]):
        assert f"\t{edge} [" in text, edge
    assert "sub<br/>geometry_msgs/Point" in text and "soft (ROS-SW)" in text


def test_lines_of_software_are_written(tmp_path: Path) -> None:
    (tmp_path / "node.py").write_text("# comment\n\n\ndef soft(message):\n    return message\n", encoding="utf-8")
    types = accelerator("soft", "Point", "Point", "ROS-SW", "node.py") + accelerator("hard", "Point", "Point")
    text = specification(row("hard", "soft", "soft"), types)
    read(tmp_path, text)
    found = report(tmp_path / "spec.yaml", load_system(tmp_path / "spec.yaml", LIBRARIES))
    assert (found.written, found.software) == (len(text.splitlines()), 2)
    assert found.ratio == found.generated / (found.written + 2)
    assert "lines written: software          2\n" in str(found)
