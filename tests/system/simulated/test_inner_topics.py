"""Systems whose blocks publish and subscribe to topics of each other: every byte of what their readers answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.system.simulated.systems import GeneratedSystem, build, call

NUMBER = "std_msgs/UInt32"
COUNT = 40

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


def side(message: str = NUMBER) -> dict[str, str]:
    return {"middleware": "ROS2", "message": message}


def converter(name: str, mode: str, topic: str, *outgoing: str, message: str = NUMBER, **keys: Any) -> dict[str, Any]:
    """A subscriber or publisher of a topic."""
    ways = {"outgoing": [{"name": item} for item in outgoing]} if outgoing else {}
    return {"name": name, **side(message), "mode": mode, "topic": topic, **keys, **ways}


def adding(name: str, amount: int, *outgoing: str) -> dict[str, Any]:
    return {"name": name, "type": f"add_{amount}", "outgoing": [{"name": item} for item in outgoing]}


@dataclass(frozen=True)
class Case:
    """A system, its stimuli, and its model: what each subscriber's number adds until it is at each publisher."""

    blocks: Sequence[Mapping[str, Any]]
    answers: Mapping[str, Mapping[str, int]]
    stimuli: Sequence[str] = ()
    project: Mapping[str, Any] = field(default_factory=dict)

    def build(self, folder: Path, width: int) -> GeneratedSystem:
        names = {str(block["type"]) for block in self.blocks if "type" in block}
        types = []
        for name in sorted(names):
            text = _JOINING if name == "joining" else _ADDING.format(name=name, amount=name.removeprefix("add_"))
            (folder / f"{name}.vhd").write_text(text)
            inputs = [side(), side()] if name == "joining" else [side()]
            interface = {"input": inputs, "output": [side()]}
            types.append({"name": name, "type": "VHDL", "sources": f"{name}.vhd", "interface": interface})
        spec = {"project": {"name": "inner", "width": width, **self.project}, "accelerators": types}
        (folder / "inner.yaml").write_text(yaml.safe_dump({**spec, "blocks": list(self.blocks)}, sort_keys=False))
        senders = self.stimuli or tuple(self.answers)
        stimuli = [{senders[number % len(senders)]: {"data": 100 + number}} for number in range(COUNT)]
        (folder / "stimuli.yaml").write_text(yaml.safe_dump(stimuli))
        (folder / "model.py").write_text(
            f"ANSWERS = {dict(self.answers)!r}\n\n\n"
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
    {"one_in": {"one_out": 1, "done": 11}, "two_in": {"done": 15}},
)
CASES = {
    "1:2": ONE_TO_TWO,
    "2:1": TWO_TO_ONE,
    "2:2": TWO_TO_TWO,
    "pipeline": PIPELINE,
    "one input": ONE_INPUT,
}


def received(system: GeneratedSystem) -> dict[int, list[int]]:
    """The numbers from each publisher in the order of their arrival, of the last simulation."""
    found: dict[int, list[int]] = {}
    for text in (system.folder / "received.txt").read_text().split("<")[1:]:
        frame = bytes.fromhex("".join(text.splitlines()[1:]))
        found.setdefault(frame[0], []).append(int.from_bytes(frame[-4:], "little"))
    return found


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("case", CASES)
def test_every_reader_answers_every_message(tmp_path: Path, case: str, width: int) -> None:
    system = CASES[case].build(tmp_path, width)
    for seed, stalls in ((1, 0), (2, 25), (3, 70)):
        assert system.passes(SEED=seed, STALL_PERCENT=stalls)


@pytest.mark.parametrize("width", [8, 64])
def test_messages_of_ways_of_different_lengths_keep_the_order_of_their_way(tmp_path: Path, width: int) -> None:
    """The order among the ways depends on stalls."""
    first, second = range(100, 100 + COUNT, 2), range(101, 100 + COUNT, 2)
    system = UNEQUAL.build(tmp_path, width)
    for seed, stalls in ((1, 0), (2, 25), (3, 70)):
        system.run(SEED=seed, STALL_PERCENT=stalls)
        to_host, done = received(system).values()
        assert to_host == [number + 1 for number in first]
        ways = {
            "one": [number + 11 for number in first],
            "two": [number + 15 for number in second],
            "far": [number + 1010 for number in second],
        }
        assert sorted(done) == sorted(number for numbers in ways.values() for number in numbers)
        for numbers in ways.values():
            places = [done.index(number) for number in numbers]
            assert places == sorted(places)


@pytest.mark.parametrize("width", [8, 64])
def test_a_reader_hears_the_host_as_well(tmp_path: Path, width: int) -> None:
    """In the order of the host, and in that of the publisher."""
    system = WITH_HOST.build(tmp_path, width)
    for seed, stalls in ((1, 0), (2, 25), (3, 70)):
        system.run(SEED=seed, STALL_PERCENT=stalls)
        (done,) = received(system).values()
        assert [number for number in done if number < 1000] == [*range(100, 100 + COUNT, 2)]
        assert [number for number in done if number > 1000] == [*range(1101, 1100 + COUNT, 2)]
