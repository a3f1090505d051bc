"""Frames, bursts, queues and back ends in C, beside what Python makes of the same bytes."""

from __future__ import annotations

import random
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from fusesoc_firm.frame import faults
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.engine.bursts import BurstError, BurstJoiner
from fusesoc_firm.node.engine.queues import ClosedError, EmptyError, SubscriberQueues
from fusesoc_firm.node.transport.abort_record import burst_of
from tests.links import coded
from tests.node.dma_engine import ERRORS, HALTED, MM2S, S2MM, Built, Engine, Fault, Loop, board
from tests.node.drivers import C_FOLDER, HERE, Driver, compile_c_driver
from tests.node.test_bursts import _interleaved
from tests.seeds import seeded

SEED = seeded(20261124)
LONGEST = 60
IDS = 3
DEPTH = 2
WIDTHS = (8, 32, 64)
BUS_BASE = 0x1000_0000
STAND_IN = HERE / "freertos_stand_in"
# What Python says, and the name of it in C.
WORDS = {
    "the burst is empty": "empty",
    "the id is": "bad_id",
    "tid is": "bad_tid",
    "contains nothing but the id": "only_id",
    "ends within a beat": "within_beat",
    "longer than its header announces": "longer",
    "the longest payload has": "too_long",
    "was aborted": "aborted",
}


@pytest.fixture(scope="module", params=["bare_metal", "freertos"])
def drivers(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[int, Driver]:
    """A driver for each width of the stream; FreeRTOS' headers are stand-ins of our own."""
    port = C_FOLDER / "ports" / request.param
    sources = [f"firm/firm_{name}.c" for name in ("frame", "bursts", "queues")]
    sources += ["ports/zynq.c", f"ports/{request.param}/firm_port.c"]
    sizes = {"FIRM_PUBLISHERS": IDS, "FIRM_SUBSCRIBERS": IDS}
    sizes |= {"FIRM_LONGEST_PAYLOAD": LONGEST, "FIRM_QUEUE_DEPTH": DEPTH}
    if request.param == "freertos":
        sizes["STAND_IN"] = 1
    return {
        width: compile_c_driver(
            "frames", tmp_path_factory.mktemp("c"), sources, [port, STAND_IN], {**sizes, "FIRM_WIDTH": width}
        )
        for width in WIDTHS
    }


def _devices(folder: Path, sizes: Mapping[str, int]) -> Driver:
    sources = [f"firm/firm_{name}.c" for name in ("frame", "limit", "link", "dma", "uart")]
    port = C_FOLDER / "ports" / "bare_metal"
    return compile_c_driver("devices", folder, sources, [port], {"FIRM_DMA_BUFFER_BYTES": 128, **sizes})


@pytest.fixture(scope="module")
def devices(tmp_path_factory: pytest.TempPathFactory) -> Driver:
    return _devices(tmp_path_factory.mktemp("devices"), {})


def test_frames_are_packed_alike(drivers: dict[int, Driver]) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    messages = [(source.randrange(256), source.randbytes(size)) for size in range(LONGEST + 2)]
    lines = [f"encode {identifier} {payload.hex()}" for identifier, payload in messages]
    expected = [pack_frame(*message).hex() if len(message[1]) <= LONGEST else "" for message in messages]
    assert drivers[8].answers(lines) == expected


def test_a_row_of_bytes_becomes_frames(drivers: dict[int, Driver]) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    frames = [pack_frame(source.randrange(IDS), source.randbytes(source.randint(0, LONGEST))) for _ in range(200)]
    row = b"".join(frames)
    lines = [f"decoder {IDS} {LONGEST + 5}"]
    while row:
        size = source.randint(1, 90)
        lines.append(f"bytes {row[:size].hex()}")
        row = row[size:]
    answers = drivers[8].answers(lines)[1:]
    found = [word for answer in answers for word in answer.split()[1:]]
    assert found == [frame.hex() for frame in frames]


@pytest.mark.parametrize(
    ("row", "word"), [("03", "bad_id"), ("02ff", "decoded"), ("023d000000", "too_long"), ("00ffffffff", "too_long")]
)
def test_bytes_that_are_no_frame_are_told(drivers: dict[int, Driver], row: str, word: str) -> None:
    answers = drivers[8].answers([f"decoder {IDS} {LONGEST + 5}", f"bytes {row}", "bytes 0000000000"])
    assert answers[1].split()[-1] == word
    if word != "decoded":
        assert answers[2] == "decoded 0000000000"


def _python_pushes(width: int, pushes: list[tuple[int | None, bytes]]) -> Iterator[str]:
    joiner = BurstJoiner(IDS, width, LONGEST)
    for tid, burst in pushes:
        try:
            sent = burst_of(burst)
            frame = joiner.push(sent.data, tid, is_aborted=sent.is_aborted)
            yield f"frame {pack_frame(frame.id, frame.payload).hex()}" if frame else "more"
        except BurstError as error:
            yield next(word for text, word in WORDS.items() if text in str(error))
    yield f"closed {len(joiner.unfinished)}"


def _lines(pushes: list[tuple[int | None, bytes]]) -> list[str]:
    words = (("-" if tid is None else str(tid), burst.hex()) for tid, burst in pushes)
    return ["joiner", *(f"push {tid} {burst}" for tid, burst in words), "close"]


@pytest.mark.parametrize("width", WIDTHS)
def test_bursts_are_joined_alike(drivers: dict[int, Driver], width: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED + width)
    for _ in range(20):
        bursts, _ = _interleaved(source, IDS, width)
        pushes: list[tuple[int | None, bytes]] = [(burst[0], burst) for burst in bursts]
        assert drivers[width].answers(_lines(pushes))[1:] == [*_python_pushes(width, pushes)]


@pytest.mark.parametrize("width", WIDTHS)
def test_a_record_aborts_a_frame_alike(drivers: dict[int, Driver], width: int) -> None:
    """The next frame with the id is whole; without the record, it would continue the aborted one."""
    print(f"seed {SEED}")
    source = random.Random(SEED + width)
    pushes: list[tuple[int | None, bytes]] = []
    for _ in range(100):
        # Beats of an aborted frame are full, and its last one is missing.
        frame = pack_frame(source.randrange(IDS), source.randbytes(LONGEST))
        whole = pack_frame(frame[0], source.randbytes(source.randint(0, LONGEST)))
        record = b"\xff" * 5 + bytes([source.choice([frame[0], frame[0], IDS]), faults.Fault.ABORTED])
        begun = frame[: width // 8 * source.randint(1, (len(frame) - 1) * 8 // width)]
        pushes += [(None, item) for item in (begun, record, whole)]
    answers = drivers[width].answers(_lines(pushes))[1:]
    assert answers == [*_python_pushes(width, pushes)]
    assert "aborted" in answers and "bad_id" in answers


@pytest.mark.parametrize("width", WIDTHS)
def test_garbage_is_told_alike(drivers: dict[int, Driver], width: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED + width)
    found = set()
    for _ in range(60):
        pushes: list[tuple[int | None, bytes]] = []
        for _ in range(30):
            burst = bytes([source.randint(0, IDS), source.choice([0, 5, 25, LONGEST, 200]), 0, 0, 0])
            burst += bytes(source.choice([source.randint(0, 20), 3 * LONGEST]))
            tid = source.choice([None, None, None, 0, 1])
            pushes.append((tid, burst[: source.choice([len(burst), source.randint(0, len(burst))])]))
        answers = drivers[width].answers(_lines(pushes))[1:]
        assert answers == [*_python_pushes(width, pushes)]
        found |= {answer.split()[0] for answer in answers}
    # At 8 bits, every burst ends with a beat; records are not garbage.
    left_out = {"aborted", "within_beat"} if width == 8 else {"aborted"}
    assert found == {"frame", "more", "closed", *WORDS.values()} - left_out


def test_queues_serve_alike(drivers: dict[int, Driver]) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    queues: SubscriberQueues[bytes] = SubscriberQueues(IDS, DEPTH)
    lines, expected = ["queues"], ["ready"]
    for _ in range(600):
        if source.random() < 0.55:
            subscriber, payload = source.randrange(IDS), source.randbytes(source.randint(0, LONGEST))
            queues.put(subscriber, pack_frame(subscriber, payload))
            lines.append(f"put {subscriber} {payload.hex()}")
            expected.append(f"kept {queues.dropped(subscriber)}")
        else:
            lines.append("get")
            try:
                subscriber, frame = queues.get(0)
                expected.append(f"{subscriber} {frame.hex()}")
            except (EmptyError, ClosedError):
                expected.append("empty")
    lines += [f"put {IDS} 00", f"put 0 {bytes(LONGEST + 1).hex()}"]
    expected += ["refused 0", "refused 0"]
    assert drivers[8].answers(lines) == expected
    assert sum(queues.dropped(subscriber) for subscriber in range(IDS)) > 20


def _board(
    root: Path, address: int = BUS_BASE, *, built: Built | None = None, faults: Sequence[Fault] = ()
) -> AbstractContextManager[Engine]:
    """A board whose system holds a whole frame, because the program receives only when it has sent one."""
    return board(root, address=address, stream=Loop(room=200), built=built, faults=faults)


def _through_the_dma(devices: Driver, root: Path, *words: object) -> str:
    return devices.answers([], "dma", str(root), *map(str, words))[0]


@pytest.mark.parametrize("longest", [100, 1000, 20000])
def test_frames_go_through_the_dma_and_back(devices: Driver, tmp_path: Path, longest: int) -> None:
    """Also those that are longer than a buffer, and than all of them; the processor has caches."""
    print(f"seed {SEED}")
    with _board(tmp_path):
        answer = _through_the_dma(devices, tmp_path, 200 if longest < 20000 else 20, longest, SEED, "plain")
    assert answer.split()[0] == "ok"


def test_the_dma_reaches_more_than_4_gib(tmp_path: Path) -> None:
    """The memory lies across the border."""
    print(f"seed {SEED}")
    address = 2**32 - 4096
    devices = _devices(tmp_path, {"FIRM_DMA_ADDRESS_BITS": 40, "BUS_BASE": address})
    with _board(tmp_path, address, built=Built(address_bits=40)):
        assert _through_the_dma(devices, tmp_path, 100, 1000, SEED, "plain").split()[0] == "ok"


@pytest.mark.parametrize("channel", [MM2S, S2MM])
@pytest.mark.parametrize("bits", ERRORS)
def test_errors_of_the_dma_are_told(devices: Driver, tmp_path: Path, channel: int, bits: int) -> None:
    """A channel has halted and says why."""
    with _board(tmp_path, faults=[Fault(7, channel, bits)]):
        answer = _through_the_dma(devices, tmp_path, 100, 2000, 1, "plain")
    found = f"{bits | HALTED:x}"
    assert answer == ("error 7 " + (f"{found} 0" if channel == MM2S else f"0 {found}"))


def test_a_reset_by_somebody_else_is_told(devices: Driver, tmp_path: Path) -> None:
    with _board(tmp_path, faults=[Fault(7, S2MM, is_reset=True)]):
        assert _through_the_dma(devices, tmp_path, 100, 2000, 1, "plain") == "error 7 1 1"


@pytest.mark.parametrize(
    ("how", "built", "answer"),
    [
        ("room", Built(), "too_long 0 0 0"),
        ("plain", Built(has_scatter_gather=False), "no_sg 0 1 1"),
        ("plain", Built(reset_seconds=1e9), "stuck 0 1 1"),
        # The same while nothing counts the ticks.
        ("frozen", Built(reset_seconds=1e9), "stuck 0 0 0"),
        # Memory beyond 4 GiB, across this border, and at an odd address.
        ("high", Built(), "memory 0 1 1"),
        ("border", Built(), "memory 0 1 1"),
        ("unaligned", Built(), "memory 0 1 1"),
    ],
)
def test_a_dma_that_does_not_start_is_told(
    devices: Driver, tmp_path: Path, how: str, built: Built, answer: str
) -> None:
    with _board(tmp_path, built=built):
        assert _through_the_dma(devices, tmp_path, 100, 2000, 1, how) == answer


@pytest.mark.parametrize("size", [2**26, 2**26 - 1, 0])
def test_buffers_that_no_descriptor_can_have_are_not_compiled(size: int) -> None:
    """A length has 26 bits; beyond them, it would change the marks of a frame's begin and end."""
    folders = [f"-I{C_FOLDER / name}" for name in ("firm", "ports/bare_metal")]
    command = ["gcc", "-std=c99", "-fsyntax-only", *folders, f"-DFIRM_DMA_BUFFER_BYTES={size}"]
    command.append(str(C_FOLDER / "firm" / "firm_dma.c"))
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "firm_dma_buffers_" in done.stderr


def test_frames_come_from_the_uart(devices: Driver) -> None:
    """What comes before the first zero is no frame; then a broken frame, an unknown publisher, and a long frame."""
    frames = [pack_frame(number % 2, bytes([number])) for number in range(3)]
    first, second, third = (coded(frame).hex() for frame in frames)
    other, long = (coded(frame).hex() for frame in (pack_frame(2, b"x"), pack_frame(0, bytes(65))))
    longest = pack_frame(1, bytes(64))
    words = [first[4:], "-", "00", first, ",", second[:4] + second[6:], other, "-", long, third, coded(longest).hex()]
    answer = devices.answers([], "uart", *words)[0]
    got = " ".join(frame.hex() for frame in (frames[0], frames[2], longest))
    sent = coded(bytes.fromhex("0001000000aa")).hex()
    assert answer == f"{got} good 3 broken 1 refused 2 breaks 1 sent {sent}"


@pytest.mark.parametrize(
    ("name", "value"), [("FIRM_WIDTH", 24), ("FIRM_PUBLISHERS", 257), ("FIRM_DMA_BUFFER_BYTES", 100)]
)
def test_illegal_sizes_are_not_compiled(tmp_path: Path, name: str, value: int) -> None:
    include = ["-I", str(C_FOLDER / "firm"), "-I", str(C_FOLDER / "ports" / "bare_metal")]
    command = ["gcc", "-std=c99", *include, "-c", str(C_FOLDER / "firm" / "firm_bursts.c"), "-o", str(tmp_path / "o")]
    assert subprocess.run(command, check=False).returncode == 0
    done = subprocess.run([*command, f"-D{name}={value}"], capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "firm_config.h" in done.stderr
