"""Verify one message, from its definition to a verdict: stimuli, reference, converters, simulation."""

from __future__ import annotations

import random
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.frame.codec import CodecError, MessageValue, encode, pack_frame, used_bytes
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.middleware import Definitions, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.runs.verify.definitions import NoJudgementError
from fusesoc_firm.runs.verify.judge import judge
from fusesoc_firm.runs.verify.loop import PUBLISHER_ID, SUBSCRIBER_ID, loop_text
from fusesoc_firm.runs.verify.simulation import OUTPUT_FILE, firm_library, simulate, write_frames
from fusesoc_firm.runs.verify.stimuli import Stimuli, kinds
from fusesoc_firm.text.diagnostics import InputError

_BENCH = "loop.vhd"
_HIGHEST_SEED = 2**31 - 86  # of the simulated host
_VHDL_ENCODING = "ascii"


class Verdict(StrEnum):
    """The verdict on a message; `REFUSED` means that the definition is illegal, so nothing could be generated."""

    PASS = "pass"
    FAIL = "fail"
    NO_JUDGE = "no judge"
    REFUSED = "refused"


@dataclass(frozen=True)
class Task:
    """A message with all nested definitions and the settings; it refers to no files, so any machine can process it."""

    name: MessageName
    definitions: Definitions
    width: int
    stimuli: int
    seed: int
    keeps_files: bool = False

    @property
    def ros(self) -> Middleware:
        """The ROS version that the message belongs to."""
        return self.definitions[self.name].ros

    def chance(self) -> random.Random:
        """Return the random generator for this message, independent of the campaign's other messages."""
        return random.Random(f"{self.seed} {self.name} {self.ros.number}")


@dataclass(frozen=True)
class Result:
    """The verdict on a message; `payload_bytes` lists the size of each stimulus's payload.

    `cycles` is the time from the first to the last beat. If the task keeps files and the message failed, `files` is the
    content of the work folder by name.
    """

    verdict: Verdict
    detail: str = ""
    judge: str = ""
    payload_bytes: tuple[int, ...] = ()
    cycles: int = 0
    seconds: float = 0.0
    files: Mapping[str, str] = field(default_factory=dict, repr=False)


def verify(task: Task) -> Result:
    """Verify a message. Raise `InputError` only if no message can be verified, because GHDL is not installed."""
    library = firm_library()
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="firm_verify_") as name:
        result = _verify_in(Path(name), task, library)
    return replace(result, seconds=round(time.perf_counter() - started, 3))


def _verify_in(folder: Path, task: Task, library: Path) -> Result:
    chance = task.chance()
    stimuli = Stimuli(task.definitions, task.ros, chance)
    values = [stimuli.message(task.name, kind) for kind in kinds(task.stimuli)]
    try:
        judgement = judge(task.name, task.definitions, values)
    except NoJudgementError as error:
        return Result(Verdict.NO_JUDGE, str(error))
    told = Result(Verdict.FAIL, "", judgement.judge, tuple(map(len, judgement.payloads)))
    try:
        frame = frame_of(task.name, task.definitions)
        sources = _write_sources(folder, frame, task.width)
    except InputError as error:
        return replace(told, detail=f"not converted: {error.diagnostics[0].message}")
    except Exception as error:  # noqa: BLE001 - a failure of the generator for one message must not end the others
        return replace(told, detail=f"not converted: {type(error).__name__}: {error}")
    # The loop cannot detect two fields that both converters swap in the same way.
    for value, payload in zip(values, judgement.payloads, strict=True):
        if fault := _layout_fault(frame, value, payload):
            return replace(told, detail=f"the layout differs from the reference's: {fault}")
    frames = [_stimulus(frame, payload, chance) for payload in judgement.payloads]
    answers = [_answer(frame, payload, sent) for payload, sent in zip(judgement.payloads, frames, strict=True)]
    write_frames(folder, frames, answers)
    outcome = simulate(folder, sources, library, chance.randint(1, _HIGHEST_SEED))
    verdict = Verdict.PASS if outcome.is_right else Verdict.FAIL
    files: dict[str, str] = {}
    if task.keeps_files and verdict is Verdict.FAIL:
        files = {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.iterdir())}
        files[OUTPUT_FILE] = outcome.output
    return replace(told, verdict=verdict, detail=outcome.detail, cycles=outcome.cycles, files=files)


def _write_sources(folder: Path, frame: Frame, width: int) -> list[str]:
    """Write the converters and the bench; return the file names in compilation order."""
    files = subscriber_files([frame], width) | publisher_files([frame], width)
    texts = {name: str(file.content) for name, file in files.items()} | {_BENCH: loop_text(frame, width)}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding=_VHDL_ENCODING)
    return list(texts)


def _layout_fault(frame: Frame, value: MessageValue, payload: bytes) -> str:
    """Return the difference between this project's layout of a value and the reference's bytes, or an empty string."""
    try:
        ours = encode(frame, value)
        used_bytes(frame, payload)
    except CodecError as error:
        return str(error)
    if ours == payload:
        return ""
    at = next((at for at, pair in enumerate(zip(ours, payload, strict=False)) if pair[0] != pair[1]), None)
    return (
        f"{len(ours)} bytes, not {len(payload)}"
        if at is None
        else f"byte {at} is {ours[at]:02x}, not {payload[at]:02x}"
    )


def _stimulus(frame: Frame, payload: bytes, chance: random.Random) -> bytes:
    """Return the frame of a payload, with random bytes in the padding and after the last field, as writers may send.

    The positions of padding are those in this project's layout. If the layout is wrong, a value is damaged, and the
    response differs from the reference.
    """
    used = used_bytes(frame, payload)
    noisy = bytes(byte if is_used else chance.randrange(256) for byte, is_used in zip(payload, used, strict=True))
    return pack_frame(SUBSCRIBER_ID, noisy + chance.randbytes(chance.randint(0, frame.trailing_bytes)))


def _answer(frame: Frame, payload: bytes, sent: bytes) -> bytes:
    """Return the expected response: the reference's bytes.

    For a message of variable size, the length equals the length in the received frame, since the publisher must send
    the length before it can detect bytes after the last field. The publisher sends zeros for these bytes.
    """
    trailing = 0 if frame.is_fixed_size else len(sent) - len(pack_frame(SUBSCRIBER_ID, payload))
    return pack_frame(PUBLISHER_ID, payload + bytes(trailing))
