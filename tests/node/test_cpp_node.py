"""The node's engine in C++ before a model of a simulator, which may die, hang, or talk nonsense."""

from __future__ import annotations

import csv
import random
import re
import shlex
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import pytest

from fusesoc_firm.node.interface.description import hardware_parameters
from fusesoc_firm.node.status.status import access
from fusesoc_firm.node.status.status_socket import NodeTransport, open_status
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.system.status_frames import write_request
from tests.node.drivers import HERE, Driver, cpp_driver
from tests.node.strangers import reply_to_stranger
from tests.seeds import seeded

SEED = seeded(20261121)
# Those of the driver.
PARAMETERS = hardware_parameters(
    ("block", "gain", "int32", -3, -(2**31), 2**31 - 1),
    ("block", "offset", "float32", 0.5, -1.5, 1e30),
    ("other", "invert", "bool", True, 0, 1),
)
SIMULATOR = f"exec {shlex.quote(sys.executable)} {shlex.quote(str(HERE / 'model_simulator.py'))}"


@dataclass
class Outcome:
    """What a node has done; `published` are the payloads by publisher."""

    published: dict[int, list[bytes]]
    said: dict[str, str]
    log: list[str]
    refused: list[str]

    def count(self, what: str) -> int:
        return int(self.said[what])


def run(
    driver: Driver,
    lines: Sequence[str],
    address: str,
    *,
    width: int = 8,
    converters: int = 2,
    depth: int = 10,
    overflow: str = "block",
    restarts: int = 0,
    drain: int = 20000,
    trace: Path | None = None,
) -> Outcome:
    numbers = [width, converters, converters, depth]
    arguments = [address, *map(str, numbers), overflow, str(restarts), str(drain), *([str(trace)] if trace else [])]
    outcome = Outcome({}, {}, [], [])
    for line in driver.answers(lines, *arguments):
        key, _, rest = line.partition(" ")
        if key == "published":
            publisher, _, payload = rest.partition(" ")
            outcome.published.setdefault(int(publisher), []).append(bytes.fromhex(payload))
        elif key == "log":
            outcome.log.append(rest)
        elif key == "refused":
            outcome.refused.append(rest)
        else:
            outcome.said[key] = rest
    return outcome


def payloads_of(source: random.Random, converters: int, count: int, most: int) -> list[tuple[int, bytes]]:
    return [(source.randrange(converters), source.randbytes(source.randint(0, most))) for _ in range(count)]


def puts(messages: Sequence[tuple[int, bytes]]) -> list[str]:
    return [f"put {converter} {payload.hex()}" for converter, payload in messages]


def by_converter(messages: Sequence[tuple[int, bytes]]) -> dict[int, list[bytes]]:
    found: dict[int, list[bytes]] = {}
    for converter, payload in messages:
        found.setdefault(converter, []).append(payload)
    return found


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("width", "run_beats"), [(8, 0), (8, 3), (64, 0), (64, 2), (512, 1)])
def test_what_is_put_comes_back_whole_and_in_order(node_driver: Driver, width: int, run_beats: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED + width + run_beats)
    messages = payloads_of(source, 5, 300, 300)
    outcome = run(
        node_driver,
        puts(messages),
        f"pipe:{SIMULATOR} --width {width} --run-beats {run_beats} --latency {source.randint(0, 5000)}",
        width=width,
        converters=5,
    )
    assert outcome.said["status"] == "0", outcome.said
    assert outcome.published == by_converter(messages)
    assert (outcome.count("sent"), outcome.count("errors"), outcome.count("dropped")) == (300, 0, 0)


def test_a_node_of_root_answers_no_other_user() -> None:
    name = f"node:model_{uuid4().hex[:8]}"
    arguments = [f"pipe:{SIMULATOR}", "8", "2", "2", "10", "block", "0", "20000", "", name]
    command = [str(cpp_driver("node").program), *arguments]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout and program.stdout.readline() == "serves\n"
        reply = reply_to_stranger(name)
        program.communicate()
    assert reply == ""


def test_a_full_disk_ends_the_trace_but_not_the_node(node_driver: Driver) -> None:
    source = random.Random(SEED)
    messages = payloads_of(source, 2, 300, 100)
    outcome = run(node_driver, puts(messages), f"pipe:{SIMULATOR}", trace=Path("/dev/full"))
    assert outcome.said["status"] == "0"
    assert outcome.published == by_converter(messages)
    assert outcome.log == ["the trace ends, since it cannot be written"]


def test_large_and_empty_payloads(node_driver: Driver) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    messages = [(0, b""), (1, source.randbytes(6_000_000)), (0, b"\0"), (1, b"")]
    outcome = run(node_driver, puts(messages), f"pipe:{SIMULATOR} --width 64", width=64)
    assert outcome.published == by_converter(messages)


@pytest.mark.parametrize("sanitizers", ["address,undefined", pytest.param("thread", marks=pytest.mark.check)])
def test_another_process_asks_for_the_status(tmp_path: Path, sanitizers: str) -> None:
    """The model returns requests as they are, so the answer to a write is its word."""
    print(f"seed {SEED}")
    source = random.Random(SEED)
    name, trace = f"node:model_{uuid4().hex[:8]}", tmp_path / "steps.csv"
    messages = payloads_of(source, 2, 200, 100)
    arguments = [f"pipe:{SIMULATOR}", "8", "2", "2", "10", "block", "0", "20000", str(trace), name]
    with subprocess.Popen(
        [cpp_driver("node", sanitizers).program, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdin and program.stdout
        assert program.stdout.readline() == "serves\n"
        feeder = threading.Thread(target=program.stdin.write, args=["\n".join([*puts(messages), ""])])
        feeder.start()
        with open_status(name) as transport:
            for address in range(0, 400, 4):
                word = source.randrange(2**32)
                assert access(transport, write_request(address, word)) == word
            assert isinstance(transport, NodeTransport)
            assert [*transport.parameters()] == [*PARAMETERS]
            transport.send(b"another frame")
            with pytest.raises(TransportError, match="not a request of the status"):
                transport.receive(20)
        feeder.join()
        rest, _ = program.communicate()
    assert program.returncode == 0
    said = dict(line.split(" ", 1) for line in rest.splitlines() if not line.startswith("published"))
    assert (said["status"], said["sent"], said["errors"]) == ("0", "200", "0")
    assert Counter(line.split(" ", 1)[1] for line in rest.splitlines() if line.startswith("published")) == Counter(
        f"{converter} {payload.hex()}" for converter, payload in messages
    )
    with trace.open() as table:
        steps = Counter(row["event"] for row in csv.DictReader(table))
    assert (steps["taken"], steps["burst"]) == (200, 200)


@pytest.mark.check
def test_threads_do_not_race() -> None:
    print(f"seed {SEED}")
    driver = cpp_driver("node", "thread")
    messages = payloads_of(random.Random(SEED), 5, 200, 100)
    outcome = run(driver, puts(messages), f"pipe:{SIMULATOR} --run-beats 3", converters=5)
    assert outcome.published == by_converter(messages)
    died = run(driver, puts(messages), f"pipe:{SIMULATOR} --fault exit --at 20", converters=5)
    assert died.said["error"] == "the simulator ended with status 3"
    hangs = run(driver, puts(messages), f"pipe:{SIMULATOR} --fault hang --at 3", overflow="drop_oldest", drain=100)
    assert hangs.said["status"] == "1"


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ("exit", "the simulator ended with status 3"),
        ("kill", "the simulator was killed by signal 9"),
        ("cut", "the simulator ended with status 4"),
        ("garbage", "byte "),
        ("unsent", "the simulator reports a frame that was not sent to it"),
        ("backwards", "the simulator reports cycle 0 after cycle "),
        ("long", "the simulator reports a burst of 4294967295 bytes; legal: 1 to 10000069"),
    ],
)
def test_a_simulator_that_fails_ends_the_node(node_driver: Driver, fault: str, error: str) -> None:
    messages = [(0, bytes([number])) for number in range(40)]
    outcome = run(node_driver, puts(messages), f"pipe:{SIMULATOR} --latency 10 --fault {fault} --at 7")
    assert outcome.said["status"] == "1"
    assert outcome.said["error"].startswith(error)
    assert outcome.log == [outcome.said["error"]]
    # What came before is published, and nothing else.
    published = outcome.published.get(0, [])
    assert 0 < len(published) <= 8 and published == [payload for _, payload in messages][: len(published)]


def test_what_came_before_a_failure_is_published_though_the_sender_meets_it_first(node_driver: Driver) -> None:
    messages = [(0, b"slow"), *((0, bytes([number])) for number in range(40))]
    outcome = run(node_driver, puts(messages), f"pipe:{SIMULATOR} --fault exit --at 20")
    assert outcome.said["error"] == "the simulator ended with status 3"
    published = outcome.published[0]
    assert 1 < len(published) <= 20 and published == [payload for _, payload in messages][: len(published)]


def test_a_simulator_that_ends_while_nothing_moves_is_noticed(node_driver: Driver) -> None:
    """Nothing is sent after its last answer."""
    outcome = run(node_driver, [*puts([(0, b"abc")]), "await 2"], f"pipe:{SIMULATOR} --fault later --at 0")
    assert outcome.published == {0: [b"abc"]}
    assert outcome.said["error"] == "the simulator ended with status 5"


def test_a_simulator_that_dies_is_started_again_on_request(node_driver: Driver, tmp_path: Path) -> None:
    mark = shlex.quote(str(tmp_path / "mark"))
    command = f"test -e {mark} || fault='--fault kill --at 20'; touch {mark}; {SIMULATOR} $fault"
    messages = [(0, number.to_bytes(2, "little")) for number in range(200)]
    outcome = run(node_driver, puts(messages), f"pipe:{command}", restarts=1)
    assert outcome.said["status"] == "0" and outcome.count("restarts") == 1
    assert outcome.log == ["the simulator was killed by signal 9; the transport is opened again"]
    # Only what the first one had is lost: at most those in flight beside the one that killed it.
    published = [int.from_bytes(payload, "little") for payload in outcome.published[0]]
    assert published == sorted(set(published)) and published[-1] == 199
    lost = {*range(200)} - {*published}
    assert lost and len(lost) <= 12 and max(lost) - min(lost) < 12


def test_restarts_are_counted(node_driver: Driver) -> None:
    outcome = run(node_driver, puts([(0, b"x")] * 40), f"pipe:{SIMULATOR} --fault exit", restarts=2)
    assert outcome.said["status"] == "1" and outcome.count("restarts") == 2
    assert len(outcome.log) == 3


def test_a_command_that_is_none(node_driver: Driver) -> None:
    outcome = run(node_driver, [], "pipe:/nowhere/simulator 2>/dev/null")
    assert outcome.said["status"] == "1"
    assert outcome.said["error"] == "the simulator ended with status 127"


def test_a_simulator_that_hangs_holds_messages_back_and_is_abandoned(node_driver: Driver) -> None:
    messages = [(0, bytes([number])) for number in range(100)]
    outcome = run(
        node_driver, puts(messages), f"pipe:{SIMULATOR} --fault hang", overflow="drop_oldest", depth=4, drain=300
    )
    assert outcome.said["status"] == "1"
    assert outcome.said["error"] == "the time limit for stopping expired before all frames were sent and received"
    # 2 are in flight, one is the sender's, 4 are in the queue.
    assert outcome.count("dropped") >= 100 - 2 - 1 - 4 and outcome.count("sent") <= 2


def test_a_simulator_that_does_not_end_is_killed(node_driver: Driver) -> None:
    outcome = run(node_driver, puts([(0, b"x")]), f"pipe:{SIMULATOR} --fault deaf --at -1")
    assert outcome.said["status"] == "0" and outcome.published == {0: [b"x"]}


def test_pulses_of_errors_are_counted(node_driver: Driver) -> None:
    outcome = run(node_driver, puts([(0, b"x")] * 3), f"pipe:{SIMULATOR} --fault error --at 1")
    assert outcome.said["status"] == "0" and outcome.count("errors") == 2
    assert [re.sub(r"cycle \d+", "cycle N", line) for line in outcome.log] == [
        "converter 1 reports an error in cycle N: the payload is longer than maxLength",
        "the link or the Manager reports an error in cycle N",
    ]


def test_a_burst_that_is_none_is_noted_and_the_rest_goes_on(node_driver: Driver) -> None:
    """A frame of a publisher that the node does not have."""
    wide = run(node_driver, ["put 0 aa", "put 1 bb", "put 2 cc", "put 0 dd", "put 0 " + "00" * 9], f"pipe:{SIMULATOR}")
    assert wide.refused == ["subscriber is 2; legal: 0 to 1"]
    assert wide.published == {0: [b"\xaa", b"\xdd", bytes(9)], 1: [b"\xbb"]}


def test_each_step_of_a_message_is_traced(node_driver: Driver, tmp_path: Path) -> None:
    messages = [(number % 2, bytes(number)) for number in range(30)]
    path = tmp_path / "trace.csv"
    run(node_driver, puts(messages), f"pipe:{SIMULATOR} --latency 100", trace=path)
    with path.open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert Counter(row["event"] for row in rows) == dict.fromkeys(
        ["received", "queued", "sent", "taken", "burst", "published"], 30
    )
    for number, (converter, payload) in enumerate(messages):
        mine = {row["event"]: row for row in rows if int(row["message"]) == number}
        way_in = [mine[event] for event in ("received", "queued", "sent", "taken")]
        assert {(int(row["converter"]), int(row["bytes"])) for row in way_in} == {(converter, len(payload))}
        times = [int(mine[event]["wall_ns"]) for event in ("received", "sent")]
        assert times == sorted(times)
        assert int(mine["taken"]["last_cycle"]) - int(mine["taken"]["first_cycle"]) + 1 == 5 + len(payload)
        assert int(mine["burst"]["first_cycle"]) > int(mine["burst"]["last_cycle"]) - 40
    taken = [int(row["first_cycle"]) for row in rows if row["event"] == "taken"]
    assert taken == sorted(taken)


@pytest.mark.parametrize("address", ["", "pipe", "pipe:", "tcp:host", "uart:/dev/ttyS0", "dma:/dev/uio0", "uart::9600"])
def test_an_address_that_is_none(node_driver: Driver, address: str) -> None:
    outcome = run(node_driver, [], address)
    assert outcome.said["error"].startswith(f"the transport is '{address}'; legal: pipe:COMMAND, uart:")


@pytest.mark.parametrize(
    ("address", "error"),
    [
        ("uart:/dev/null:fast", "the baud rate is 'fast', which is not a number"),
        ("uart:/nowhere/tty:9600:rtscts", "/nowhere/tty: No such file or directory"),
        ("uart:/dev/null:9600", "/dev/null: Inappropriate ioctl for device"),
        (
            "dma:/dev/uio99:udmabuf0",
            "cannot read /sys/class/uio/uio99/maps/map0/size; check whether the driver is loaded",
        ),
    ],
)
def test_a_device_that_is_none(node_driver: Driver, address: str, error: str) -> None:
    assert run(node_driver, [], address).said["error"] == error
