"""Systems with an accelerator that misbehaves: the other channels keep their rate, and the fault is reported."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.system.hardware.status import status_map
from fusesoc_firm.system.status_frames import read_request, status_answer
from tests.hdl.frames import traffic, write_stimulus
from tests.seeds import seeded
from tests.system.simulated.systems import DATA, GeneratedSystem, build, call

SEED = seeded(20250118)
POINT, VECTOR = "geometry_msgs/Point", "geometry_msgs/Vector3"
PAYLOAD_BYTES = 24
GOOD, BAD = 0, 1
FRAMES = 3
COUNT = 200
LIMIT = 32


def _system(folder: Path, width: int, accelerator: str, *, takes: bool = False, **keys: str | int) -> GeneratedSystem:
    """A channel that returns Points, and one from a subscriber with `keys` through an accelerator."""
    folder.mkdir()
    text = (DATA / f"{accelerator}.vhd").read_text()
    (folder / f"{accelerator}.vhd").write_text(
        text.replace("ready      <= '0'", "ready      <= '1'") if takes else text
    )
    sides = [{"middleware": "ROS1", "message": VECTOR}]
    blocks = [
        _converter("good", "subscriber", POINT, outgoing=[{"name": "good_back"}]),
        _converter("bad", "subscriber", VECTOR, outgoing=[{"name": "acc"}], **keys),
        {"name": "acc", "type": accelerator, "outgoing": [{"name": "bad_back"}]},
        _converter("good_back", "publisher", POINT),
        _converter("bad_back", "publisher", VECTOR),
    ]
    interface = {"input": sides, "output": sides}
    source = {"name": accelerator, "type": "VHDL", "sources": f"{accelerator}.vhd", "interface": interface}
    project = {"name": "faulty", "width": width, "watchdog": LIMIT}
    content = {"project": project, "accelerators": [source], "blocks": blocks}
    (folder / "faulty.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    (folder / "stimuli.yaml").write_text("- good: {x: 1.0, y: 2.0, z: 3.0}\n")
    (folder / "model.py").write_text("def respond(subscriber, message):\n    return []\n")
    return build(call(folder / "faulty.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def _converter(name: str, mode: str, message: str, **more: object) -> dict[str, object]:
    return {"name": name, "middleware": "ROS1", "mode": mode, "message": message, **more}


def _ros2(name: str, mode: str, message: str, **more: object) -> dict[str, object]:
    return _converter(name, mode, message, middleware="ROS2", **more)


def _exchange(system: GeneratedSystem, ids: list[int], faults: int) -> int:
    """Send frames of these ids, and expect those of the good channel back; return the number of cycles."""
    source = random.Random(SEED)
    frames = [pack_frame(id_, source.randbytes(PAYLOAD_BYTES)) for id_ in ids]
    write_stimulus(system.folder / "stimulus.txt", frames)
    answers = [f"< @{n} frame\n  {frame.hex()}\n" for n, frame in enumerate(frames) if frame[0] == GOOD]
    (system.folder / "expected.txt").write_text(f"! frame_error {faults}\n{''.join(answers)}")
    result = system.run(SEED=SEED, STALL_PERCENT=0)
    assert result.exit_code == 0, result.output
    return traffic(result.output).cycles


@pytest.mark.parametrize("width", [8, pytest.param(64, marks=pytest.mark.check)])
@pytest.mark.parametrize("overflow", ["drop_newest", "drop_oldest"])
def test_an_accelerator_that_never_takes(tmp_path: Path, width: int, overflow: str) -> None:
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    ids = [source.choice([GOOD, BAD]) for _ in range(COUNT)]
    ids[-1] = GOOD
    deaf = _system(tmp_path / "deaf", width, "deaf", queue=FRAMES, overflow=overflow)
    # One message is offered to the accelerator.
    dropped = ids.count(BAD) - FRAMES - 1
    cycles = _exchange(deaf, ids, dropped)
    healthy = _system(tmp_path / "healthy", width, "deaf", takes=True, queue=FRAMES, overflow=overflow)
    assert cycles <= _exchange(healthy, ids, 0)


@pytest.mark.parametrize("width", [8, pytest.param(64, marks=pytest.mark.check)])
def test_an_accelerator_that_never_takes_without_a_queue(tmp_path: Path, width: int) -> None:
    """The watchdog costs the host its limit once; from then on, the subscriber's frames are dropped."""
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    ids = [source.choice([GOOD, BAD]) for _ in range(COUNT)]
    ids[-1] = GOOD
    deaf = _system(tmp_path / "deaf", width, "deaf", overflow="drop_newest")
    healthy = _system(tmp_path / "healthy", width, "deaf", takes=True, overflow="drop_newest")
    # One message is offered to the accelerator.
    assert _exchange(deaf, ids, ids.count(BAD) - 1) <= _exchange(healthy, ids, 0) + LIMIT


@pytest.mark.parametrize("width", [8, pytest.param(64, marks=pytest.mark.check)])
def test_an_accelerator_that_takes_again(tmp_path: Path, width: int) -> None:
    """The first text leaves as aborted, the next ones are dropped, and those after the pause are right."""
    system = _dozing(tmp_path / "dozing", width)
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    early, late = 5, 5
    # The accelerator takes again during the points.
    frames = [_text(source) for _ in range(early)]
    frames += [_point(source) for _ in range(100 if width == 8 else 800)]
    frames += [_text(source) for _ in range(late)]
    write_stimulus(system.folder / "stimulus.txt", frames)
    answers = [f"< @0 answer\n  {BAD:02x}\n! aborted {BAD} 10\n"]
    answers += [f"< @{place} answer\n  {frame.hex()}\n" for place, frame in enumerate(frames) if place >= early]
    # Of the first text, the publisher reports its own frame as well.
    (system.folder / "expected.txt").write_text(f"! frame_error {early + 1}\n{''.join(answers)}")
    result = system.run(SEED=SEED, STALL_PERCENT=0)
    assert result.exit_code == 0, result.output


def _dozing(folder: Path, width: int) -> GeneratedSystem:
    """A channel that returns Points, and one that returns texts but takes none at first."""
    folder.mkdir()
    (folder / "doze.vhd").write_text((DATA / "doze.vhd").read_text())
    sides = [{"middleware": "ROS2", "message": "std_msgs/String"}]
    source = {"name": "doze", "type": "VHDL", "sources": "doze.vhd", "interface": {"input": sides, "output": sides}}
    blocks = [
        _ros2("good", "subscriber", POINT, outgoing=[{"name": "good_back"}]),
        _ros2("bad", "subscriber", "std_msgs/String", outgoing=[{"name": "acc"}], overflow="drop_newest"),
        {"name": "acc", "type": "doze", "outgoing": [{"name": "bad_back"}]},
        _ros2("good_back", "publisher", POINT),
        _ros2("bad_back", "publisher", "std_msgs/String"),
    ]
    project = {"name": "faulty", "width": width, "watchdog": LIMIT}
    content = {"project": project, "accelerators": [source], "blocks": blocks}
    (folder / "faulty.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    (folder / "stimuli.yaml").write_text("- good: {x: 1.0, y: 2.0, z: 3.0}\n")
    (folder / "model.py").write_text("def respond(subscriber, message):\n    return []\n")
    return build(call(folder / "faulty.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def _text(source: random.Random) -> bytes:
    letters = bytes(source.choices(b"abcdefghijklmnopqrstuvwxyz", k=source.randint(200, 300))) + b"\0"
    return pack_frame(BAD, _CDR + len(letters).to_bytes(4, "little") + letters)


HEALTHY = "none"
# The width of the stream, and the bytes of an id.
SHAPES = [
    (8, 1),
    (8, 2),
    pytest.param(64, 1, marks=pytest.mark.check),
    pytest.param(64, 2, marks=pytest.mark.thorough),
]
# Each response to such a number is faulty.
SICK = [number for number in range(20, 60) if number % 8 == 7]
WELL = [number for number in range(20, 60) if number % 8 != 7]
CODES = {
    "pauses": Fault.WATCHDOG,
    "stops": Fault.WATCHDOG,
    "ends early": Fault.SHORT_FRAME,
    "goes on": Fault.LONG_FRAME,
}
_CDR = bytes.fromhex("00010000")


def _texts(folder: Path, width: int, fault: str, queue: int, id_bytes: int = 1, **keys: int) -> GeneratedSystem:
    """A channel that returns Points, and one that responds to a number with a text of this length, and a fault."""
    folder.mkdir()
    text = (DATA / "falter.vhd").read_text()
    (folder / "falter.vhd").write_text(text.replace(f':= "{HEALTHY}"', f':= "{fault}"'))
    interface = {
        "input": [{"middleware": "ROS2", "message": "std_msgs/UInt16"}],
        "output": [{"middleware": "ROS2", "message": "std_msgs/String"}],
    }
    source = {"name": "falter", "type": "VHDL", "sources": "falter.vhd", "interface": interface}
    blocks = [
        _ros2("good", "subscriber", POINT, outgoing=[{"name": "good_back"}]),
        _ros2("bad", "subscriber", "std_msgs/UInt16", outgoing=[{"name": "acc"}], queue=queue, overflow="drop_newest"),
        {"name": "acc", "type": "falter", "outgoing": [{"name": "bad_back"}]},
        _ros2("good_back", "publisher", POINT),
        _ros2("bad_back", "publisher", "std_msgs/String", **keys),
    ]
    project = {"name": "faulty", "width": width, "status": "frames", "watchdog": LIMIT, "idBytes": id_bytes}
    content = {"project": project, "accelerators": [source], "blocks": blocks}
    (folder / "faulty.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    (folder / "stimuli.yaml").write_text("- good: {x: 1.0, y: 2.0, z: 3.0}\n")
    (folder / "model.py").write_text("def respond(subscriber, message):\n    return []\n")
    return build(call(folder / "faulty.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def _point(source: random.Random) -> bytes:
    return pack_frame(GOOD, _CDR + source.randbytes(24))


def _number(number: int) -> bytes:
    return pack_frame(BAD, _CDR + number.to_bytes(2, "little"))


def _with_id(frame: bytes, id_bytes: int) -> bytes:
    """A frame whose id has one byte, with an id of so many bytes."""
    return frame[:1] + bytes(id_bytes - 1) + frame[1:]


def _answer(frame: bytes, fault: str, id_bytes: int = 1) -> str:
    """The lines of the expected frame for a frame to the system, both with an id of one byte or of so many."""
    number = int.from_bytes(frame[-2:], "little")
    if frame[0] == BAD and number in SICK and fault != HEALTHY:
        return "" if fault == "is silent" else f"  {BAD.to_bytes(id_bytes, 'little').hex()}\n! aborted {BAD} 10\n"
    letters = bytes(ord("a") + place % 26 for place in range(number))
    text = pack_frame(BAD, _CDR + (number + 1).to_bytes(4, "little") + letters + b"\0")
    return f"  {_with_id(frame if frame[0] == GOOD else text, id_bytes).hex()}\n"


def _run(
    system: GeneratedSystem,
    frames: list[bytes],
    fault: str,
    faults: int,
    answered: set[int] | None = None,
    id_bytes: int = 1,
) -> int:
    """Send the frames, and expect the responses to `answered`, by default to all; return the number of cycles."""
    write_stimulus(system.folder / "stimulus.txt", [_with_id(frame, id_bytes) for frame in frames], id_bytes=id_bytes)
    answers = "".join(
        f"< @{place} answer\n{lines}"
        for place, frame in enumerate(frames)
        if (answered is None or place in answered) and (lines := _answer(frame, fault, id_bytes))
    )
    (system.folder / "expected.txt").write_text(f"! frame_error {faults}\n{answers}")
    result = system.run(SEED=SEED, STALL_PERCENT=0)
    assert result.exit_code == 0, result.output
    return traffic(result.output).cycles


@pytest.fixture(scope="module")
def healthy_cycles() -> dict[tuple[int, int], int]:
    """Those of the frames beside a healthy accelerator, by width and bytes of an id."""
    return {}


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("width", "id_bytes"), SHAPES)
@pytest.mark.parametrize("fault", ["pauses", "ends early", "goes on"])
def test_an_accelerator_whose_response_is_faulty_now_and_then(
    tmp_path: Path, healthy_cycles: dict[tuple[int, int], int], width: int, fault: str, id_bytes: int
) -> None:
    """The other channel keeps 99 % of the rate that it has beside a healthy accelerator."""
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    count = 600 if width == 8 else 1500
    numbers = [source.choice(SICK if source.random() < 0.05 else WELL) for _ in range(100)]
    texts = [_number(number) for number in numbers]
    frames = [_point(source) for _ in range(count)]
    for place, frame in zip(sorted(source.sample(range(count), len(texts))), texts, strict=True):
        frames[place] = frame
    sick = sum(number in SICK for number in numbers)
    assert sick
    # The same for each fault.
    shape = width, id_bytes
    if shape not in healthy_cycles:
        system = _texts(tmp_path / "healthy", width, HEALTHY, 128, id_bytes)
        healthy_cycles[shape] = _run(system, frames, HEALTHY, 0, id_bytes=id_bytes)
    healthy = healthy_cycles[shape]
    cycles = _run(_texts(tmp_path / "faulty", width, fault, 128, id_bytes), frames, fault, sick, id_bytes=id_bytes)
    print(f"{fault}: {cycles} cycles, {healthy} beside a healthy accelerator")
    assert 99 * cycles <= 100 * healthy


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("width", "id_bytes"), SHAPES)
@pytest.mark.parametrize("fault", ["stops", "is silent"])
def test_an_accelerator_that_answers_no_more(tmp_path: Path, width: int, fault: str, id_bytes: int) -> None:
    """The other channel keeps 99 % of the rate that it has alone; the host's stream also carries the dropped frames."""
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    count = 600 if width == 8 else 1500
    frames = [_point(source) if source.random() < 0.8 else _number(source.choice(SICK)) for _ in range(count)]
    frames[-1] = _point(source)
    good = [place for place, frame in enumerate(frames) if frame[0] == GOOD]
    bad = [place for place, frame in enumerate(frames) if frame[0] == BAD]
    system = _texts(tmp_path / "faulty", width, fault, FRAMES, id_bytes)
    faults = len(bad) - FRAMES - 1 + (fault == "stops")
    cycles = _run(system, frames, fault, faults, {*good, bad[0]}, id_bytes)
    alone = _run(system, [frames[place] for place in good], fault, 0, id_bytes=id_bytes)
    beats = sum(-(-len(_with_id(frames[place], id_bytes)) // (width // 8)) for place in bad)
    print(f"{fault}: {cycles} cycles; {alone} alone, and {beats} beats")
    assert 99 * cycles <= 100 * (alone + beats)


@pytest.mark.parametrize("id_bytes", [1, 2])
@pytest.mark.parametrize("fault", CODES)
def test_the_status_has_the_code_at_the_channel(tmp_path: Path, fault: str, id_bytes: int) -> None:
    registers = status_map("faulty", 2, 2)
    code = CODES[fault].value
    system = _texts(tmp_path / "faulty", 8, fault, FRAMES, id_bytes)
    values = {f"publisher[{BAD}].faults[{code - 1}]": 1, f"publisher[{GOOD}].faults[{code - 1}]": 0}
    # A register that never changes; the responses leave meanwhile.
    reads = [("magic", 0x4D524946)] * 60 + [*values.items()]
    sent = [_number(SICK[0]), _point(random.Random(SEED))]
    frames = [_with_id(frame, id_bytes) for frame in sent]
    frames += [read_request(registers.by_name[name].address, id_bytes) for name, _ in reads]
    write_stimulus(system.folder / "stimulus.txt", frames, id_bytes=id_bytes)
    answers = [f"< @{place} answer\n{_answer(frame, fault, id_bytes)}" for place, frame in enumerate(sent)]
    answers += [
        f"< @{place} read\n  {status_answer(registers.by_name[name].address, word, id_bytes).hex()}\n"
        for place, (name, word) in enumerate(reads, start=len(sent))
    ]
    (system.folder / "expected.txt").write_text(f"! frame_error 1\n{''.join(answers)}")
    result = system.run(SEED=SEED, STALL_PERCENT=0)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("width", [8, pytest.param(32, marks=pytest.mark.check)])
def test_an_accelerator_whose_response_is_too_long(tmp_path: Path, width: int) -> None:
    """Its frame is refused with code 7, and the accelerator goes on; a beat of several bytes is not even begun."""
    letters = 40
    system = _texts(tmp_path / "faulty", width, HEALTHY, 8, maxLength=len(_CDR) + 4 + letters + 1)
    code = Fault.TOO_LONG.value
    registers = status_map("faulty", 2, 2)
    reads = [("magic", 0x4D524946)] * 100 + [(f"publisher[{BAD}].faults[{code - 1}]", 2)]
    numbers = [letters, letters + 1, 7, 1000, letters]
    sent = [_number(number) for number in numbers]
    frames = [*sent[:2], _point(random.Random(SEED)), *sent[2:]]
    frames += [read_request(registers.by_name[name].address) for name, _ in reads]
    write_stimulus(system.folder / "stimulus.txt", frames)
    aborted = f"  {BAD:02x}\n! aborted {BAD} 10\n" if width == 8 else ""
    answers = [
        f"< @{place} answer\n{lines}"
        for place, frame in enumerate(frames[: len(numbers) + 1])
        if (lines := aborted if place in (1, 4) else _answer(frame, HEALTHY))
    ]
    answers += [
        f"< @{place} read\n  {status_answer(registers.by_name[name].address, word).hex()}\n"
        for place, (name, word) in enumerate(reads, start=len(numbers) + 1)
    ]
    (system.folder / "expected.txt").write_text(f"! frame_error 2\n{''.join(answers)}")
    result = system.run(SEED=SEED, STALL_PERCENT=0)
    assert result.exit_code == 0, result.output
