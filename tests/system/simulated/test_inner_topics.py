"""Systems whose blocks publish and subscribe to topics of each other: every byte of what their readers answer."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.exploration.worst_case import worst_times
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.noc.model import Beat, Model
from fusesoc_firm.noc.network import Network
from fusesoc_firm.system.hardware.registers import Register
from fusesoc_firm.system.hardware.status import ENDPOINT_WORDS, Features, Part, endpoint_register, status_map
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.status_frames import read_request, status_answer
from fusesoc_firm.system.written.specification import TOPOLOGIES
from fusesoc_firm.text.diagnostics import InputError
from tests.hdl.frames import write_stimulus
from tests.hdl.verilator import simulator
from tests.hdl.verilog import compile_verilog, translated
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

NUMBER = "std_msgs/UInt32"
COUNT = 40
SEED = seeded(20261130)

# An accelerator that adds a number, and holds one message: it takes the next one when its answer is taken.
_ADDING = """library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity {name} is
  port (
    clk, rst_n        : in  std_logic;
    in_data           : in  std_logic_vector(31 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;
    out_data          : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity;

architecture rtl of {name} is
  signal valid_r : std_logic := '0';
begin
  out_segment_valid(0) <= valid_r;
  in_msg_ready         <= not valid_r;
  process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        valid_r <= '0';
      elsif valid_r = '0' then
        valid_r  <= in_msg_valid;
        out_data <= std_logic_vector(unsigned(in_data) + {amount});
      elsif out_msg_ready = '1' then
        valid_r <= '0';
      end if;
    end if;
  end process;
end architecture;
"""
# An accelerator that joins two messages, and takes both when its answer is taken.
_JOINING = """library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity joining is
  port (
    clk, rst_n        : in  std_logic;
    in0_data          : in  std_logic_vector(31 downto 0);
    in0_segment_valid : in  std_logic_vector(0 downto 0);
    in0_msg_valid     : in  std_logic;
    in0_msg_ready     : out std_logic;
    in1_data          : in  std_logic_vector(31 downto 0);
    in1_segment_valid : in  std_logic_vector(0 downto 0);
    in1_msg_valid     : in  std_logic;
    in1_msg_ready     : out std_logic;
    out_data          : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity;

architecture rtl of joining is
  signal valid : std_logic;
begin
  valid                <= in0_msg_valid and in1_msg_valid;
  out_segment_valid(0) <= valid;
  out_data             <= std_logic_vector(unsigned(in0_data) + 1000 * unsigned(in1_data(15 downto 0)));
  in0_msg_ready        <= valid and out_msg_ready;
  in1_msg_ready        <= valid and out_msg_ready;
end architecture;
"""
# An accelerator that adds up its first input, whose sum returns to it through its second input.
_SUMMING = (
    _JOINING.replace("entity joining", "entity summing")
    .replace("of joining", "of summing")
    .replace(
        """  signal valid : std_logic;
begin
  valid                <= in0_msg_valid and in1_msg_valid;
""",
        """  signal valid   : std_logic;
  signal first_r : std_logic := '1';
begin
  valid <= in0_msg_valid and (in1_msg_valid or first_r);
  process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        first_r <= '1';
      elsif valid = '1' and out_msg_ready = '1' then
        first_r <= '0';
      end if;
    end if;
  end process;
""",
    )
    .replace(
        "unsigned(in0_data) + 1000 * unsigned(in1_data(15 downto 0))",
        "unsigned(in0_data) + unsigned(in1_data)) when first_r = '0' else std_logic_vector(unsigned(in0_data)",
    )
    .replace("in1_msg_ready        <= valid", "in1_msg_ready        <= not first_r and valid")
)
# An accelerator that takes no message.
_STUCK = _ADDING.replace("not valid_r;", "'0';").replace("<= in_msg_valid;", "<= '0';")


def source_of(name: str) -> str:
    """The text of an accelerator."""
    known = {"joining": _JOINING, "summing": _SUMMING, "stuck": _STUCK.format(name="stuck", amount=0)}
    return known.get(name) or _ADDING.format(name=name, amount=name.removeprefix("add_"))


def side(message: str = NUMBER) -> dict[str, str]:
    return {"middleware": "ROS2", "message": message}


def converter(name: str, mode: str, topic: str, *outgoing: str, message: str = NUMBER, **keys: Any) -> dict[str, Any]:
    """A subscriber or publisher of a topic."""
    ways = {"outgoing": [{"name": item} for item in outgoing]} if outgoing else {}
    return {"name": name, **side(message), "mode": mode, "topic": topic, **keys, **ways}


def adding(name: str, amount: int, *outgoing: str, **keys: Any) -> dict[str, Any]:
    return {"name": name, "type": f"add_{amount}", **keys, "outgoing": [{"name": item} for item in outgoing]}


@dataclass(frozen=True)
class Case:
    """A system, its stimuli, and its model: what each subscriber's number adds until it is at each publisher."""

    blocks: Sequence[Mapping[str, Any]]
    answers: Mapping[str, Mapping[str, int]]
    model: str = ""
    project: Mapping[str, Any] = field(default_factory=dict)

    def build(self, folder: Path, width: int, **project: Any) -> GeneratedSystem:
        names = {str(block["type"]) for block in self.blocks if "type" in block}
        types = []
        for name in sorted(names):
            (folder / f"{name}.vhd").write_text(source_of(name))
            inputs = [side(), side()] if name in ("joining", "summing") else [side()]
            interface = {"input": inputs, "output": [side()]}
            types.append({"name": name, "type": "VHDL", "sources": f"{name}.vhd", "interface": interface})
        spec = {"project": {"name": "inner", "width": width, **self.project, **project}, "accelerators": types}
        (folder / "inner.yaml").write_text(yaml.safe_dump({**spec, "blocks": list(self.blocks)}, sort_keys=False))
        senders = tuple(self.answers)
        stimuli = [{senders[number % len(senders)]: {"data": 100 + number}} for number in range(COUNT)]
        (folder / "stimuli.yaml").write_text(yaml.safe_dump(stimuli))
        (folder / "model.py").write_text(
            self.model
            or f"ANSWERS = {dict(self.answers)!r}\n\n\n"
            "def respond(subscriber, message):\n"
            "    return [(name, {'data': message['data'] + more}) for name, more in ANSWERS[subscriber].items()]\n"
        )
        return build(call(folder / "inner.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


ONE_TO_TWO = Case(
    [
        converter("raw", "subscriber", "raw", "first"),
        adding("first", 1, "middle"),
        converter("middle", "publisher", "middle"),
        converter("left_in", "subscriber", "middle", "left"),
        converter("right_in", "subscriber", "middle", "right"),
        adding("left", 10, "left_out"),
        adding("right", 20, "right_out"),
        converter("left_out", "publisher", "left"),
        converter("right_out", "publisher", "right"),
    ],
    {"raw": {"middle": 1, "left_out": 11, "right_out": 21}},
)
TWO_TO_ONE = Case(
    [
        converter("one_in", "subscriber", "one", "one"),
        converter("two_in", "subscriber", "two", "two"),
        adding("one", 1, "one_out"),
        adding("two", 2, "two_out"),
        converter("one_out", "publisher", "middle", deliver="fabric"),
        converter("two_out", "publisher", "middle", deliver="fabric"),
        converter("reader_in", "subscriber", "middle", "reader"),
        adding("reader", 10, "done"),
        converter("done", "publisher", "done"),
    ],
    {"one_in": {"done": 11}, "two_in": {"done": 12}},
)
TWO_TO_TWO = Case(
    [
        *TWO_TO_ONE.blocks,
        converter("other_in", "subscriber", "middle", "other", qos={"depth": 3}),
        adding("other", 20, "other_out"),
        converter("other_out", "publisher", "other"),
    ],
    {"one_in": {"done": 11, "other_out": 21}, "two_in": {"done": 12, "other_out": 22}},
)
PIPELINE = Case(
    [
        converter("raw", "subscriber", "raw", "first"),
        adding("first", 1, "first_out"),
        converter("first_out", "publisher", "a", deliver="fabric"),
        converter("second_in", "subscriber", "a", "second", queue=2),
        adding("second", 2, "second_out"),
        converter("second_out", "publisher", "b"),
        converter("third_in", "subscriber", "b", "third"),
        adding("third", 4, "third_out"),
        converter("third_out", "publisher", "c"),
    ],
    {"raw": {"second_out": 3, "third_out": 7}},
)
# The reader of a topic hears the host as well, and its subscriber feeds a publisher without an accelerator between.
WITH_HOST = Case(
    [
        converter("raw", "subscriber", "raw", "first"),
        adding("first", 1000, "first_out"),
        converter("first_out", "publisher", "middle", deliver="fabric"),
        converter("reader", "subscriber", "middle", "done", deliver="both", queue=2),
        converter("done", "publisher", "done"),
    ],
    {"reader": {"done": 0}, "raw": {"done": 1000}},
)
# Two accelerators feed one input without a topic.
ONE_INPUT = Case(
    [
        converter("one_in", "subscriber", "one", "one"),
        converter("two_in", "subscriber", "two", "two"),
        adding("one", 1, "sink"),
        adding("two", 2, "sink"),
        adding("sink", 10, "out"),
        converter("out", "publisher", "out"),
    ],
    {"one_in": {"out": 11}, "two_in": {"out": 12}},
)
# Ways of different lengths, which end at one reader.
UNEQUAL = Case(
    [
        converter("one_in", "subscriber", "one", "one"),
        converter("two_in", "subscriber", "two", "two", "far"),
        adding("one", 1, "one_out"),
        adding("two", 2, "three"),
        adding("three", 3, "two_out"),
        adding("far", 1000, "far_out"),
        converter("one_out", "publisher", "middle"),
        converter("two_out", "publisher", "middle", deliver="fabric"),
        converter("far_out", "publisher", "middle", deliver="fabric"),
        converter("reader_in", "subscriber", "middle", "reader", queue=4),
        adding("reader", 10, "done"),
        converter("done", "publisher", "done"),
    ],
    {"one_in": {"one_out": 1, "done": 11}, "two_in": {}},
    "def respond(subscriber, message):\n    number = message['data']\n    if subscriber == 'one_in':\n"
    "        return [('one_out', {'data': number + 1}), ('done', {'data': number + 11})]\n"
    "    return [('done', {'data': number + 15}), ('done', {'data': number + 1010})]\n",
)
# One reader takes nothing; its queue drops messages.
STUCK = Case(
    [
        *ONE_TO_TWO.blocks[:3],
        converter("stuck_in", "subscriber", "middle", "stuck", queue=2, overflow="drop_oldest"),
        {"name": "stuck", "type": "stuck", "outgoing": [{"name": "never"}]},
        converter("never", "publisher", "never"),
        converter("right_in", "subscriber", "middle", "right"),
        adding("right", 20, "right_out"),
        converter("right_out", "publisher", "right"),
    ],
    {"raw": {"middle": 1, "right_out": 21}},
)
# Three clocks.
CLOCKS = Case(
    [
        converter("raw", "subscriber", "raw", "first"),
        adding("first", 1, "first_out", clock="fast"),
        converter("first_out", "publisher", "a", deliver="fabric"),
        converter("second_in", "subscriber", "a", "second", queue=2),
        adding("second", 2, "second_out", clock="slow"),
        converter("second_out", "publisher", "b"),
        converter("third_in", "subscriber", "b", "third"),
        adding("third", 4, "third_out", clock="fast"),
        converter("third_out", "publisher", "c"),
    ],
    PIPELINE.answers,
    project={
        "clock": "100 MHz",
        "clocks": [{"name": "fast", "frequency": "170 MHz"}, {"name": "slow", "frequency": "30 MHz"}],
    },
)
# The sum is a topic that returns to its accelerator through a queue.
FEEDBACK = Case(
    [
        converter("raw", "subscriber", "raw", "sum"),
        {"name": "sum", "type": "summing", "outgoing": [{"name": "sum_out"}]},
        converter("sum_out", "publisher", "total"),
        converter("total_in", "subscriber", "total", "sum", queue=2),
    ],
    {"raw": {}},
    "total = 0\n\n\ndef respond(_, message):\n    global total\n    total += message['data']\n"
    "    return [('sum_out', {'data': total})]\n",
)
CASES = {
    "a reader that takes nothing": STUCK,
    "three clocks": CLOCKS,
    "feedback": FEEDBACK,
    "ways of different lengths": UNEQUAL,
    "with host": WITH_HOST,
    "1:2": ONE_TO_TWO,
    "2:1": TWO_TO_ONE,
    "2:2": TWO_TO_TWO,
    "pipeline": PIPELINE,
    "one input": ONE_INPUT,
}


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("case", CASES)
def test_every_reader_answers_every_message(tmp_path: Path, case: str, width: int) -> None:
    system = CASES[case].build(tmp_path, width)
    for seed, stalls in ((1, 0), (2, 25), (3, 70)):
        assert system.passes(SEED=seed, STALL_PERCENT=stalls)


@pytest.mark.parametrize(("width", "fabric"), [(8, "wires"), (64, "wires"), (8, "mesh"), (64, "crossbar")])
def test_the_netlist_does_the_same_and_has_no_latch(tmp_path: Path, width: int, fabric: str) -> None:
    system = TWO_TO_TWO.build(tmp_path, width, fabric=fabric)
    assert system.work.latches(system.entity) == []
    system.replace_by_netlist()
    assert system.passes(SEED=4, STALL_PERCENT=30)


FABRICS = ["crossbar", "mesh", "chain"]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("fabric", FABRICS)
@pytest.mark.parametrize("case", ["2:1", "2:2", "pipeline", "with host", "three clocks", "a reader that takes nothing"])
def test_an_exchange_answers_every_message(tmp_path: Path, case: str, fabric: str, width: int) -> None:
    system = CASES[case].build(tmp_path, width, fabric=fabric)
    assert (tmp_path / "work" / "inner_system_exchange.vhd").is_file()
    for seed, stalls in ((1, 0), (2, 25), (3, 70)):
        assert system.passes(SEED=seed, STALL_PERCENT=stalls)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize(
    ("case", "fabric"), [("1:2", "wires"), ("2:1", "crossbar"), ("2:2", "mesh"), ("pipeline", "crossbar")]
)
def test_no_message_takes_longer_than_its_bound(tmp_path: Path, case: str, fabric: str, width: int) -> None:
    """If the host sends and takes a beat in each cycle."""
    system = CASES[case].build(tmp_path, width, fabric=fabric, scheduler="round_robin")
    specification = yaml.safe_load((tmp_path / "inner.yaml").read_text())
    for type_ in specification["accelerators"]:
        type_ |= {"latency": 1, "interval": 2}
    (tmp_path / "declared.yaml").write_text(yaml.safe_dump(specification, sort_keys=False))
    loaded = load_beside(tmp_path / "declared.yaml")
    bounds = [item for item in worst_times(loaded) if not item.topic]
    assert all(item.cycles for item in bounds), bounds
    result = system.run(SEED=1, STALL_PERCENT=0, SHOWN=10 * COUNT)
    first_beats = re.findall(r"(\d+) last beat in to first beat out", result.output)
    beats = max(item.transfer_time or 0 for item in loaded.system.scheduling.times)
    slowest = max(map(int, first_beats)) + beats - 1
    assert slowest <= max(item.cycles or 0 for item in bounds) < 7 * slowest


@pytest.mark.parametrize(("fabric", "frames"), [("crossbar", 1), ("mesh", 2)])
def test_a_status_counts_at_each_endpoint(tmp_path: Path, fabric: str, frames: int) -> None:
    """A crossbar copies a frame to both readers, of which one takes nothing, so that its queue drops messages."""
    system = STUCK.build(tmp_path, 8, fabric=fabric, status="frames")
    exchange = load_beside(tmp_path / "inner.yaml").system.exchange
    assert exchange
    places = {end.block: number for number, end in enumerate(exchange.ends)}
    registers = status_map("inner", 1, 3, features=Features(Part.EXCHANGE, len(exchange.ends))).by_name
    counts = dict.fromkeys(((end, word) for end in places.values() for word in ENDPOINT_WORDS), 0)
    counts[places["first"], "sent"] = frames * COUNT
    counts[places["first"], "stalled"] = stalled_cycles(exchange.network, COUNT)
    counts[places["stuck"], "received"] = counts[places["right"], "received"] = COUNT
    counts[places["stuck"], "dropped"] = COUNT - 2
    # Reading a register takes time, so that messages do not meet.
    pause = [("magic", 0x4D524946)] * 20
    ends = [("exchange", len(exchange.ends)), *((endpoint_register(*key), count) for key, count in counts.items())]
    sent: list[tuple[bytes, list[bytes]]] = []
    for number in range(COUNT):
        answers = [pack_frame(0, value(number + 1)), pack_frame(2, value(number + 21))]
        sent += [(pack_frame(0, value(number)), answers), *asked(registers, pause)]
    sent += asked(registers, [*pause, *ends])
    write_stimulus(system.folder / "stimulus.txt", (frame for frame, _ in sent))
    lines = [f"< @{number} frame\n  {answer.hex()}\n" for number, (_, answers) in enumerate(sent) for answer in answers]
    (system.folder / "expected.txt").write_text("".join(lines))
    assert system.passes(SEED=1)
    assert system.work.latches(system.entity) == []


def value(number: int) -> bytes:
    """The payload of a number."""
    return b"\x00\x01\x00\x00" + number.to_bytes(4, "little")


def asked(registers: Mapping[str, Register], words: Sequence[tuple[str, int]]) -> list[tuple[bytes, list[bytes]]]:
    """Requests of registers, with the answers."""
    addresses = [(registers[name].address, word) for name, word in words]
    return [(read_request(address), [status_answer(address, word)]) for address, word in addresses]


def stalled_cycles(network: Network, count: int) -> int:
    """The cycles in which beats of the only source wait in the model, for messages of four beats that do not meet."""
    model, found = Model(network), 0
    source = network.flows[0].source
    for _ in range(count):
        beats = [Beat(flow, place == 3) for flow in range(len(network.flows)) for place in range(4)]
        for _ in range(50):
            taken, _ = model.step({source: beats[0]} if beats else {}, lambda _: True)
            found += bool(beats) and not taken
            del beats[: len(taken)]
    return found


# --- any system ------------------------------------------------------------------------------------------------------


@dataclass
class Adder:
    """An accelerator, the topics at its sides, and what a message of each subscriber has become behind it."""

    amount: int
    read: str
    written: str
    sums: list[tuple[str, int]]


def random_case(source: random.Random) -> Case:
    """Layers of accelerators that read topics of earlier layers; some topics have several publishers and readers."""
    adders: dict[str, Adder] = {}
    for layer in range(source.randint(2, 4)):
        known = sorted({item.written for item in adders.values()})
        own: list[str] = []
        for place in range(source.randint(1, 3)):
            name, amount = f"a{layer}{place}", source.randint(1, 9)
            read = source.choice([*known, f"raw_{name}"])
            before = [found for item in adders.values() if item.written == read for found in item.sums]
            own.append(source.choice([*own, f"t{layer}{place}"]))
            sums = [(entry, total + amount) for entry, total in before or [(f"{name}_in", 0)]]
            adders[name] = Adder(amount, read, own[-1], sums)
    all_read = {item.read for item in adders.values()}
    blocks: list[dict[str, Any]] = []
    answers: dict[str, list[tuple[str, int]]] = {entry: [] for item in adders.values() for entry, _ in item.sums}
    for name, item in adders.items():
        is_inner = not item.read.startswith("raw")
        queue: dict[str, Any] = {"queue": source.randint(1, 4)} if is_inner and source.random() < 0.4 else {}
        stays = item.written in all_read and source.random() < 0.4 and name != "a00"
        blocks += [
            converter(f"{name}_in", "subscriber", item.read, name, **queue),
            adding(name, item.amount, f"{name}_out"),
            converter(f"{name}_out", "publisher", item.written, **({"deliver": "fabric"} if stays else {})),
        ]
        for entry, total in [] if stays else item.sums:
            answers[entry].append((f"{name}_out", total))
    model = (
        f"ANSWERS = {answers!r}\n\n\ndef respond(subscriber, message):\n"
        "    return [(name, {'data': message['data'] + more}) for name, more in ANSWERS[subscriber]]\n"
    )
    return Case(blocks, {name: dict(found) for name, found in answers.items()}, model)


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 500), marks=pytest.mark.thorough)])
def test_random_systems_answer_every_message(tmp_path: Path, seeds: range) -> None:
    """With every fabric; one that might stop is refused."""
    passed = 0
    for number in seeds:
        source = random.Random(f"{SEED} {number}")
        case = random_case(source)
        fabric, width = source.choice(["wires", *TOPOLOGIES]), source.choice([8, 16, 32, 64, 128])
        print(f"seed {SEED}, system {number}: {fabric}, {width} bits")
        folder = tmp_path / str(number)
        folder.mkdir()
        try:
            system = case.build(folder, width, fabric=fabric)
        except InputError as error:
            fault = str(error)
        else:
            fault = ""
        if fault:
            assert "messages may wait for each other in the routers" in fault
            assert fabric not in ("wires", "crossbar")
            continue
        assert system.passes(SEED=number + 1, STALL_PERCENT=source.choice([0, 25, 60]))
        passed += 1
    assert passed > len(seeds) / 2


# --- messages of variable size ---------------------------------------------------------------------------------------

TEXT = "std_msgs/String"


def texts(folder: Path, width: int, readers: Sequence[str], **keys: Any) -> GeneratedSystem:
    """A system without accelerators that returns texts; `keys` are those of the publishers that meet."""
    blocks = [
        converter("one", "subscriber", "one", "one_out", message=TEXT, maxLength=300),
        converter("two", "subscriber", "two", "two_out", message=TEXT, maxLength=300),
        converter("one_out", "publisher", "middle", message=TEXT, **keys),
        converter("two_out", "publisher", "middle", message=TEXT, **keys),
    ]
    buffer = {"buffer": 300} if len(readers) > 1 or "buffer" in keys else {}
    for name in readers:
        blocks.append(converter(name, "subscriber", "middle", f"{name}_out", message=TEXT))
        blocks.append(converter(f"{name}_out", "publisher", name, message=TEXT, **buffer))
    spec = {"project": {"name": "inner", "width": width}, "blocks": blocks}
    (folder / "inner.yaml").write_text(yaml.safe_dump(spec, sort_keys=False))
    (folder / "stimuli.yaml").write_text("- one: {data: first}\n")
    (folder / "model.py").write_text("def respond(subscriber, message):\n    return []\n")
    return build(call(folder / "inner.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def text_frames(count: int, source: random.Random) -> tuple[list[bytes], set[int], dict[int, list[bytes]]]:
    """Frames of texts for two subscribers in turn, those that are aborted, and the other payloads by subscriber."""
    frames: list[bytes] = []
    aborted: set[int] = set()
    whole: dict[int, list[bytes]] = {0: [], 1: []}
    for number in range(count):
        text = f"{number} ".encode() + bytes(source.choices(b"abcdef", k=source.randint(1, 280)))
        payload = bytes.fromhex("00010000") + (len(text) + 1).to_bytes(4, "little") + text + b"\0"
        frame = pack_frame(number % 2, payload)
        if source.random() < 0.3:
            aborted.add(number)
            frame = frame[: source.randint(2, len(frame))]
        else:
            whole[number % 2].append(payload)
        frames.append(frame)
    return frames, aborted, whole


@pytest.mark.parametrize("readers", [["left"], ["left", "right"]])
@pytest.mark.parametrize("width", [8, 64])
def test_texts_meet_and_an_aborted_one_reaches_no_reader(tmp_path: Path, width: int, readers: Sequence[str]) -> None:
    print(f"texts from seed {SEED}")
    system = texts(tmp_path, width, readers, deliver="fabric")
    frames, aborted, whole = text_frames(100, random.Random(SEED))
    for stalls in (0, 40):
        found = whole_payloads(system, frames, aborted, stalls)
        assert len(found) == len(readers)
        for payloads in found.values():
            assert sorted(payloads) == sorted([*whole[0], *whole[1]])
            for own in whole.values():
                assert [payload for payload in payloads if payload in own] == own


@pytest.mark.parametrize("width", [8, 64])
def test_texts_also_go_to_the_host(tmp_path: Path, width: int) -> None:
    """A publisher with a buffer does not hold the Manager while its text waits for its turn."""
    print(f"texts from seed {SEED}")
    system = texts(tmp_path, width, ["left"], buffer=300)
    frames, aborted, whole = text_frames(100, random.Random(SEED))
    for stalls in (0, 40):
        found = whole_payloads(system, frames, aborted, stalls)
        assert (found[0], found[1]) == (whole[0], whole[1])
        assert sorted(found[2]) == sorted([*whole[0], *whole[1]])


def whole_payloads(
    system: GeneratedSystem, frames: Sequence[bytes], aborted: Collection[int], stalls: int
) -> dict[int, list[bytes]]:
    """The payloads of a simulation by their publishers; the publisher of an aborted text may have begun its frame."""
    write_stimulus(system.folder / "stimulus.txt", frames, aborted)
    (system.folder / "expected.txt").write_text("")
    system.run(SEED=SEED, STALL_PERCENT=stalls, SHOWN=0)
    found: dict[int, list[bytes]] = {}
    for item in (system.folder / "received.txt").read_text().split("<")[1:]:
        if "! aborted" not in item:
            frame = bytes.fromhex("".join(item.splitlines()[1:]))
            found.setdefault(frame[0], []).append(frame[5:])
    return found


@pytest.mark.check
@pytest.mark.skipif(
    not all(map(shutil.which, ("iverilog", "verilator"))), reason="Icarus Verilog or Verilator is not installed"
)
@pytest.mark.parametrize(("fabric", "width"), [("wires", 8), ("crossbar", 32), ("mesh", 8)])
def test_the_netlist_in_both_simulators(tmp_path: Path, fabric: str, width: int) -> None:
    UNEQUAL.build(tmp_path, width, fabric=fabric)
    request = call(tmp_path / "inner.yaml", tmp_path / "stimuli.yaml", tmp_path / "model.py")
    folder = tmp_path / "netlist"
    top, files = translated(request, folder)
    icarus = compile_verilog(top, files, folder).run(folder, SEED=3)
    assert icarus.exit_code == 0, icarus.output
    done = subprocess.run(
        [str(simulator(top, files, folder)), "+SEED=3"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    assert f"PASS {2 * COUNT}/{2 * COUNT}" in done.stdout
