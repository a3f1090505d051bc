"""Topics that a system both publishes and subscribes to: who meets whom, by which hardware, and how it is shown."""

from __future__ import annotations

import itertools
import random
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.system.derived.connections import cycles_of
from fusesoc_firm.system.derived.joins import joins
from fusesoc_firm.system.derived.model import DerivedSystem, End
from fusesoc_firm.system.hardware.waits import wires
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.system.views.diagram import diagram
from fusesoc_firm.system.views.inner_topics import topics_description, ways_of_topics
from fusesoc_firm.system.views.show import counts
from fusesoc_firm.text.diagnostics import InputError
from tests.random_systems import RandomSystem, random_system
from tests.seeds import seeded
from tests.system.systems import LIBRARIES, accelerator, converter, derived, instance, specification

SEED = seeded(20261130)
PASSING = accelerator("passing", "Point", "Point")
JOINING = accelerator("joining", "Point Point", "Point")


def on(topic: str, line: str, more: str = "") -> str:
    """A converter's line of `blocks` with a topic and further keys."""
    return line.replace("}\n", f", topic: {topic}{more}}}\n")


def pair(first: str = "", second: str = "") -> str:
    """Two accelerators and the topic between them, with further keys of its publisher and subscriber."""
    return (
        converter("raw", "subscriber", "Point", "first")
        + instance("first", "passing", "first_out")
        + on("middle", converter("first_out", "publisher", "Point"), first)
        + on("middle", converter("second_in", "subscriber", "Point", "second"), second)
        + instance("second", "passing", "done")
        + converter("done", "publisher", "Point")
    )


def two(first: str = "", second: str = "", reader: str = "") -> str:
    """Two accelerators that publish on one topic, which a third one reads."""
    return (
        converter("raw", "subscriber", "Point", "first", "other")
        + instance("first", "passing", "first_out")
        + instance("other", "passing", "other_out")
        + on("a/middle", converter("first_out", "publisher", "Point"), first)
        + on("a/middle", converter("other_out", "publisher", "Point"), second)
        + on("a/middle", converter("reader_in", "subscriber", "Point", "reader"), reader)
        + instance("reader", "passing", "done")
        + converter("done", "publisher", "Point")
    )


def ways(system: DerivedSystem) -> list[tuple[str, str]]:
    """The blocks of all connections, with the prefixes of inputs."""
    return [
        (item.source.block, f"{sink.block}/{sink.prefix}".rstrip("/"))
        for item in system.connections
        for sink in item.sinks
    ]


def blocks(system: DerivedSystem) -> tuple[list[str], list[str]]:
    return [item.block for item in system.subscribers], [item.block for item in system.publishers]


def load(folder: Path, blocks: str, types: str = PASSING) -> tuple[DerivedSystem, list[str]]:
    """A system and its warnings."""
    (folder / "acc.vhd").touch()
    path = folder / "spec.yaml"
    path.write_text(specification(blocks, types), encoding="utf-8")
    loaded = load_system(path, LIBRARIES)
    return loaded.system, [item.message for item in loaded.warnings]


@pytest.mark.parametrize(
    ("first", "second", "connections", "converters", "line"),
    [
        (
            "",
            "",
            [("raw", "first/in_"), ("first", "first_out"), ("first", "second/in_"), ("second", "done")],
            (["raw"], ["first_out", "done"]),
            "topic /middle: first_out -> second_in within the FPGA by wires; first_out also to the host",
        ),
        (
            ", deliver: fabric",
            "",
            [("raw", "first/in_"), ("first", "second/in_"), ("second", "done")],
            (["raw"], ["done"]),
            (
                "topic /middle: first_out -> second_in within the FPGA by wires; first_out not to the host"
                " ('deliver: fabric')"
            ),
        ),
        (
            ", deliver: host",
            "",
            [("raw", "first/in_"), ("first", "first_out"), ("second_in", "second/in_"), ("second", "done")],
            (["raw", "second_in"], ["first_out", "done"]),
            "topic /middle: by the host, because of 'deliver: host'",
        ),
        (
            "",
            ", queue: 3, overflow: drop_oldest",
            [
                ("raw", "first/in_"),
                ("first", "second_in_queue/in_"),
                ("first", "first_out"),
                ("second", "done"),
                ("second_in_queue", "second/in_"),
            ],
            (["raw"], ["first_out", "done"]),
            (
                "topic /middle: first_out -> second_in within the FPGA by a queue of 3 messages (second_in_queue);"
                " first_out also to the host"
            ),
        ),
        (
            ", deliver: fabric",
            ", deliver: both",
            [
                ("raw", "first/in_"),
                ("first", "second_in_merge/in0_"),
                ("second_in", "second_in_merge/in1_"),
                ("second", "done"),
                ("second_in_merge", "second/in_"),
            ],
            (["raw", "second_in"], ["done"]),
            (
                "topic /middle: first_out -> second_in within the FPGA by a merge of 2 sources (second_in_merge);"
                " first_out not to the host ('deliver: fabric'); second_in also from the host ('deliver: both')"
            ),
        ),
    ],
)
def test_the_way_of_a_topic(
    tmp_path: Path,
    first: str,
    second: str,
    connections: list[tuple[str, str]],
    converters: tuple[list[str], list[str]],
    line: str,
) -> None:
    system, warnings = load(tmp_path, pair(first, second))
    assert ways(system) == connections
    assert blocks(system) == converters
    assert ways_of_topics(system) == [line]
    assert warnings == []


def test_publishers_of_one_topic_meet_in_a_merge(tmp_path: Path) -> None:
    system, warnings = load(tmp_path, two(", deliver: fabric", reader=", qos: {depth: 4}"))
    assert ways(system) == [
        ("raw", "first/in_"),
        ("raw", "other/in_"),
        ("first", "a_middle_merge/in0_"),
        ("other", "a_middle_merge/in1_"),
        ("other", "other_out"),
        ("reader", "done"),
        ("a_middle_merge", "reader_in_queue/in_"),
        ("reader_in_queue", "reader/in_"),
    ]
    assert warnings == []
    assert counts(system) == "1 subscriber, 3 accelerators, 2 publishers"
    assert ways_of_topics(system) == [
        (
            "topic /a/middle: first_out, other_out -> reader_in within the FPGA by a merge of 2 sources"
            " (a_middle_merge), a queue of 4 messages (reader_in_queue); other_out also to the host;"
            " first_out not to the host ('deliver: fabric')"
        )
    ]
    assert topics_description(system) == {
        "Topics": [
            {
                "topic": "/a/middle",
                "publishers": ["first_out", "other_out"],
                "readers": ["reader_in"],
                "toHost": ["other_out"],
            }
        ],
        "Junctions": [
            {"block": "a_middle_merge", "nameMW": "geometry_msgs/Point", "topic": "/a/middle", "sources": 2},
            {"block": "reader_in_queue", "nameMW": "geometry_msgs/Point", "topic": "/a/middle", "queue": 4},
        ],
    }
    assert ("a_middle_merge", "reader_in_queue") in wires(system)
    text = diagram(system)
    assert "<b>merge of 2</b><br/>/a/middle<br/>geometry_msgs/Point" in text
    assert "<b>queue: 4 messages</b>" in text


def test_a_picture_names_the_topic_of_a_wire(tmp_path: Path) -> None:
    text = diagram(derived(tmp_path, specification(pair(), PASSING)))
    assert "/middle<br/>192 bits" in text


def exchanged(fabric: str, blocks: str) -> str:
    """The blocks in a specification whose topics pass an exchange."""
    return specification(blocks, PASSING + JOINING).replace("{name: robot", f"{{name: robot, fabric: {fabric}")


def derived_from(folder: Path, text: str) -> tuple[DerivedSystem, list[str]]:
    (folder / "acc.vhd").touch()
    path = folder / "spec.yaml"
    path.write_text(text, encoding="utf-8")
    loaded = load_system(path, LIBRARIES)
    return loaded.system, [item.message for item in loaded.warnings]


def test_a_topic_passes_the_exchange(tmp_path: Path) -> None:
    """The publisher's own way to the host stays, and so does a queue; one endpoint may have both directions."""
    blocks = two(", deliver: fabric", reader=", qos: {depth: 4}")
    system, warnings = derived_from(tmp_path, exchanged("crossbar", blocks))
    assert ways(system) == [
        ("raw", "first/in_"),
        ("raw", "other/in_"),
        ("first", "a_middle_exchange/in0_"),
        ("other", "a_middle_exchange/in1_"),
        ("other", "other_out"),
        ("reader", "done"),
        ("a_middle_exchange", "reader_in_queue/in_"),
        ("reader_in_queue", "reader/in_"),
    ]
    assert warnings == []
    assert ways_of_topics(system) == [
        (
            "topic /a/middle: first_out, other_out -> reader_in within the FPGA by the exchange, a crossbar of 3"
            " endpoints, a queue of 4 messages (reader_in_queue); other_out also to the host; first_out not to the"
            " host ('deliver: fabric')"
        )
    ]
    found = topics_description(system)
    assert found["Junctions"][0] == {
        "block": "a_middle_exchange",
        "nameMW": "geometry_msgs/Point",
        "topic": "/a/middle",
        "sources": 2,
        "readers": 1,
    }
    assert found["Exchange"] == {
        "topology": "crossbar",
        "routers": 1,
        "turns": 2,
        "endpoints": [
            {"block": "first", "router": 0, "sends": "a_middle_exchange"},
            {"block": "other", "router": 0, "sends": "a_middle_exchange"},
            {"block": "reader", "router": 0, "receives": "a_middle_exchange"},
        ],
    }
    assert "<b>exchange: 2 to 1</b><br/>/a/middle" in diagram(system)


def test_an_endpoint_sends_and_receives(tmp_path: Path) -> None:
    """In a chain, each block is next to the one that it sends to, so that no two topics share a link."""
    text = exchanged(
        "chain",
        converter("raw", "subscriber", "Point", "one")
        + instance("one", "passing", "a_out")
        + on("a", converter("a_out", "publisher", "Point"), ", deliver: fabric")
        + on("b", converter("b_in", "subscriber", "Point", "three"))
        + instance("three", "passing", "done")
        + on("a", converter("a_in", "subscriber", "Point", "two"))
        + instance("two", "passing", "b_out")
        + on("b", converter("b_out", "publisher", "Point"), ", deliver: fabric")
        + converter("done", "publisher", "Point"),
    )
    system, _ = derived_from(tmp_path, text)
    exchange = system.exchange
    assert exchange is not None
    places = dict(zip((end.block for end in exchange.ends), exchange.network.places, strict=True))
    assert {abs(places["one"] - places["two"]), abs(places["two"] - places["three"])} == {1}
    assert [(end.source is None, end.sink is None) for end in exchange.ends] == [
        (False, True),
        (False, False),
        (True, False),
    ]


def test_a_fabric_without_a_topic_is_warned_of(tmp_path: Path) -> None:
    lines = converter("raw", "subscriber", "Point", "done") + converter("done", "publisher", "Point")
    system, warnings = derived_from(tmp_path, exchanged("mesh", lines))
    assert system.exchange is None
    assert warnings == ["'fabric: mesh' has no effect: no topic of fixed size is within the FPGA"]


def test_blocks_meet_at_an_input(tmp_path: Path) -> None:
    lines = (
        converter("raw", "subscriber", "Point", "one", "two")
        + instance("one", "passing", "sink")
        + instance("two", "passing", "sink")
        + instance("sink", "passing", "out")
        + converter("out", "publisher", "Point")
    )
    system, _ = load(tmp_path, lines)
    assert ("one", "sink_in_merge/in0_") in ways(system)
    assert ("sink_in_merge", "sink/in_") in ways(system)
    assert ways_of_topics(system) == [
        "input of sink: one, two by a merge, since each of them provides the whole message"
    ]


def test_a_reader_of_system_and_host_has_one_queue(tmp_path: Path) -> None:
    system, _ = load(tmp_path, pair(", deliver: fabric", ", deliver: both, queue: 2, overflow: drop_newest"))
    assert [item.queue for item in system.subscribers] == [None, None]
    assert [(item.block, item.depth) for item in system.junctions] == [("second_in_merge", 0), ("second_in_queue", 2)]
    assert ("second_in_merge", "second_in_queue/in_") in ways(system)


def test_only_fields_with_a_reader_pass_a_merge(tmp_path: Path) -> None:
    """A publisher that is a reader's only sink takes one field."""
    lines = (
        converter("raw", "subscriber", "Point", "one_out", "two_out")
        + on("t", converter("one_out", "publisher", "Point"), ", deliver: fabric")
        + on("t", converter("two_out", "publisher", "Point"), ", deliver: fabric")
        + on("t", converter("reader", "subscriber", "Point", "done")).replace("name: done", "name: done, include: [y]")
        + converter("done", "publisher", "Point")
    )
    system, _ = load(tmp_path, lines, "")
    (junction,) = system.junctions
    (leaf,) = [leaf for node in junction.frame.nodes for leaf in getattr(node, "fields", ()) if leaf.is_used]
    assert leaf.names == ("y",)


@pytest.mark.parametrize("depth", [1, 2])
def test_a_queue_of_two_messages_breaks_a_cycle(tmp_path: Path, depth: int) -> None:
    """An accelerator may hold its message until its answer is taken."""
    lines = (
        converter("raw", "subscriber", "Point", "acc")
        + instance("acc", "joining", "state")
        + on("state", converter("state", "publisher", "Point"))
        + on("state", converter("state_in", "subscriber", "Point", "acc"), f", queue: {depth}")
    )
    if depth == 1:
        with pytest.raises(InputError, match=r"wait for each other: acc -> state -> state_in -> acc"):
            load(tmp_path, lines, JOINING)
        return
    system, _ = load(tmp_path, lines, JOINING)
    assert ("acc", "state_in_queue/in_") in ways(system)
    assert ("state_in_queue", "acc/in1_") in ways(system)


@pytest.mark.parametrize(("queue", "count"), [("", 1), (", queue: 2", 0)])
def test_two_ways_to_one_block_are_warned_of(tmp_path: Path, queue: str, count: int) -> None:
    lines = (
        converter("raw", "subscriber", "Point", "first")
        + instance("first", "passing", "between", "first_out")
        + on("t", converter("first_out", "publisher", "Point"), ", deliver: fabric")
        + on("t", converter("join_in", "subscriber", "Point", "join"), queue)
        + instance("between", "passing", "join")
        + instance("join", "joining", "done")
        + converter("done", "publisher", "Point")
    )
    _, warnings = load(tmp_path, lines, PASSING + JOINING)
    assert warnings == ["messages take two ways: first -> join and first -> between -> join"][:count]


def test_a_join_behind_a_merge_is_warned_of(tmp_path: Path) -> None:
    """The merge may forward a message of the other block, so that the join waits for ever."""
    lines = (
        converter("raw", "subscriber", "Point", "one", "two")
        + instance("one", "passing", "merged")
        + instance("two", "passing", "merged", "join")
        + instance("merged", "passing", "join")
        + instance("join", "joining", "done")
        + converter("done", "publisher", "Point")
    )
    _, warnings = load(tmp_path, lines, PASSING + JOINING)
    assert warnings == ["messages take two ways: two -> join and two -> merged_in_merge -> merged -> join"]


def test_a_publisher_beside_a_merge_of_texts_has_a_buffer(tmp_path: Path) -> None:
    """Otherwise, it would hold the Manager while its stream waits for its turn."""
    text = "std_msgs/String"
    lines = (
        converter("one", "subscriber", text, "one_out")
        + converter("two", "subscriber", text, "two_out")
        + on("t", converter("one_out", "publisher", text), ", buffer: 50")
        + on("t", converter("two_out", "publisher", text), ", deliver: fabric")
        + on("t", converter("reader", "subscriber", text, "counting"))
        + instance("counting", "counting", "done")
        + converter("done", "publisher", "Point")
    )
    types = accelerator("counting", text, "Point")
    system, _ = load(tmp_path, lines, types)
    assert [item.buffer for item in system.publishers] == [50, 0]
    with pytest.raises(
        InputError, match=r"'one_out' needs a 'buffer': its streams also wait where the message of 'one'"
    ):
        load(tmp_path, lines.replace(", buffer: 50", ""), types)


def test_a_relative_name_meets_no_absolute_one(tmp_path: Path) -> None:
    """A node in a namespace has two topics."""
    lines = pair().replace("topic: middle, ", "topic: middle, ").replace("topic: middle}", "topic: /middle}", 1)
    system, warnings = load(tmp_path, lines)
    assert blocks(system) == (["raw", "second_in"], ["first_out", "done"])
    assert warnings == ["'first_out' publishes on topic /middle, to which 'second_in' subscribes"]


def test_cycles_are_those_of_a_sorter() -> None:
    """In random graphs: there is a cycle if and only if the graph has no order, and each one consists of edges."""
    source = random.Random(20261130)
    names = [f"b{number}" for number in range(8)]
    seen = set()
    for _ in range(300):
        graph = {name: source.sample(names, source.randint(0, 2)) for name in names}
        found = list(cycles_of(graph, names))
        try:
            TopologicalSorter(graph).prepare()
            has_order = True
        except CycleError:
            has_order = False
        assert has_order is not bool(found)
        seen.add(has_order)
        for way in found:
            assert way[0] == way[-1]
            assert all(before in graph[block] for before, block in itertools.pairwise(way))
    assert seen == {True, False}


def test_ways_of_equal_lengths_join(tmp_path: Path) -> None:
    lines = (
        converter("raw", "subscriber", "Point", "one", "two")
        + instance("one", "passing", "join")
        + instance("two", "passing", "join")
        + instance("join", "joining", "done")
        + converter("done", "publisher", "Point")
    )
    system = derived(tmp_path, specification(lines, PASSING + JOINING))
    assert list(joins(system.connections)) == []
    longer = lines.replace("{name: one}, ", "{name: zero}, ", 1) + instance("zero", "passing", "one")
    (join,) = joins(derived(tmp_path, specification(longer, PASSING + JOINING)).connections)
    assert (join.sink, join.shorter) == (End("join", "in1_"), ("raw", "two", "join"))
    assert join.longer == ("raw", "zero", "one", "join")


# --- any system -------------------------------------------------------------------------------------------------------


def with_topics(made: RandomSystem, chance: random.Random) -> tuple[str, int]:
    """The specification with topics in place of some connections, and their number."""
    content = yaml.safe_load(made.text)
    keys = {block["name"]: block for block in content["blocks"]}
    frames = _messages(content)
    added: list[dict[str, Any]] = []
    for (block, message), sinks in made.sinks.items():
        for way in keys[block]["outgoing"]:
            others = [other for (name, other), ends in made.sinks.items() if name == block and way["name"] in ends]
            if way["name"] in sinks and len(others) == 1 and chance.random() < 0.4:
                number = len(added) // 2
                side = {**frames[str(message)], "topic": f"t{number}"}
                added.append({"name": f"t{number}_out", **side, "mode": "publisher", "deliver": "fabric"})
                outgoing = [dict(way)]
                added.append({"name": f"t{number}_in", **side, "mode": "subscriber", "outgoing": outgoing})
                way["name"] = f"t{number}_out"
    content["blocks"] = [*content["blocks"], *added]
    return yaml.safe_dump(content, sort_keys=False, width=1000), len(added) // 2


def _messages(content: Any) -> dict[str, dict[str, str]]:
    """The keys of each message, by its name."""
    interfaces = [item["interface"] for item in content.get("accelerators", ())]
    sides = [side for item in interfaces for side in (*item["input"], *item["output"])]
    found = [*sides, *(block for block in content["blocks"] if "message" in block)]
    return {item["message"]: {"middleware": item["middleware"], "message": item["message"]} for item in found}


def flow(system: DerivedSystem) -> set[tuple[End, End, Frame]]:
    return {
        (item.source, sink, frame)
        for item in system.connections
        for sink, frame in zip(item.sinks, item.frames, strict=True)
    }


@pytest.mark.parametrize("number", range(12))
def test_a_topic_within_the_fpga_is_a_connection(number: int, tmp_path: Path) -> None:
    print(f"seed {SEED + number}")
    chance = random.Random(SEED + number)
    made = random_system(chance, 5 + 2 * number, 3 + number // 2)
    text, count = with_topics(made, chance)
    systems = []
    for name, content in (("plain.yaml", made.text), ("topics.yaml", text)):
        (tmp_path / name).write_text(content, encoding="utf-8")
        systems.append(load_system(tmp_path / name, LIBRARIES, needs_sources=False).system)
    plain, topics = systems
    assert len(topics.inner_topics) == count > 0
    assert flow(topics) == flow(plain)
    assert (topics.subscribers, topics.publishers) == (plain.subscribers, plain.publishers)
