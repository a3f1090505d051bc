"""The driver of an overlay, on a board with the model of the engine, and with PYNQ's channels for other engines."""

from __future__ import annotations

import random
import sys
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from fusesoc_firm import CodecError, InputError
from fusesoc_firm.export.pynq.driver import Driver, EngineTransport
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.engine.bursts import AbortedFrameError, BurstError
from fusesoc_firm.node.transport.transport import Burst, TransportError
from fusesoc_firm.node.transport.whole_beats import frame_in, in_whole_beats
from tests.export.pynq.stand_in import SPECIFICATION, Board, Channel, SimpleDma, add_files, board, driver_of, written
from tests.node.dma_engine import DMA_DECODE, MM2S
from tests.seeds import seeded

SEED = seeded(20261201)


@pytest.fixture
def driver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> type[Driver]:
    package = written(tmp_path)
    add_files(package)
    return driver_of(package, monkeypatch)


class Bursts:
    """A transport that has received bursts."""

    def __init__(self, *bursts: Burst) -> None:
        self._bursts = deque(bursts)
        self.sent: list[bytes] = []

    def send(self, frame: bytes) -> None:
        """Keep a frame."""
        self.sent.append(frame)

    def has_room(self, size: int) -> bool:
        """Return True."""
        return size > 0

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next burst."""
        return self._bursts.popleft() if self._bursts else None


def message(number: int, length: int = 0) -> dict[str, Any]:
    header = {"stamp": {"sec": number, "nanosec": 0}, "frame_id": "f" * length}
    return {"header": header, "point": {"x": number / 3, "y": -1.0, "z": 0.0}}


def exchange(overlay: Driver, count: int) -> None:
    """Send random messages in lots of random size; all come back in order."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    while count > 0:
        lot = [message(number, chance.randrange(60)) for number in range(min(count, chance.randrange(1, 80)))]
        block = chance.choice(["left", "right"])
        overlay.send(block, *lot)
        assert overlay.receive_all(len(lot)) == [(f"{block}_out", item) for item in lot]
        count -= len(lot)
    assert overlay.receive(timeout=0.0) is None
    assert overlay.receive_all(2, timeout=0.0) == []


def test_messages_there_and_back(driver: type[Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    """A lot is larger than all buffers of the engine and of the loop."""
    with board(monkeypatch) as stand_in, driver() as overlay:
        exchange(overlay, 500)
        resets = stand_in.engine.resets
        overlay.close()
    assert stand_in.engine.resets == resets + 1
    assert stand_in.loaded == [(str(driver.BITSTREAM), True)]


def test_messages_by_the_channels_of_pynq(driver: type[Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    """For an engine without scatter-gather; PYNQ's driver tells its exact lengths."""
    dma = SimpleDma()
    with board(monkeypatch, parameters={"c_include_sg": "0"}, dma=dma), driver(download=False) as overlay:
        exchange(overlay, 500)
    assert dma.resets == 2


class Words:
    """The engine of cocotbpynq: channels that tell nothing, and words of 32 bits."""

    def __init__(self) -> None:
        self._dma = SimpleDma()
        self.sendchannel, self.recvchannel = (
            Words.Channel(each) for each in (self._dma.sendchannel, self._dma.recvchannel)
        )

    class Channel:
        """A channel without `idle` and `transferred`."""

        def __init__(self, channel: Channel) -> None:
            channel.start()
            self._channel = channel
            self.wait = channel.wait

        def transfer(self, array: Any, start: int = 0, nbytes: int = 0) -> None:
            """Begin a transfer."""
            assert nbytes % 4 == 0
            self._channel.transfer(array, start, nbytes)


def test_messages_in_whole_beats(driver: type[Driver]) -> None:
    """The loop returns the zeros after the messages, which a codec of ROS 2 skips."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    with driver.over(Words(), np.zeros, drives_tkeep=False) as overlay:
        for number in range(200):
            sent = message(number, chance.randrange(60))
            overlay.send("right", sent)
            assert overlay.receive() == ("right_out", sent)
        assert overlay.receive(timeout=0) is None


def test_a_frame_in_whole_beats_is_found_again() -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    for _ in range(300):
        payload, beat_bytes = chance.randbytes(chance.randrange(70)), chance.choice([1, 2, 4])
        frame = pack_frame(3, payload)
        sent = in_whole_beats(frame, beat_bytes)
        assert len(sent) % beat_bytes == 0
        assert len(sent) - len(frame) < beat_bytes
        assert frame_in(sent + chance.randbytes(64)) == sent
        assert sent == pack_frame(3, payload + bytes(len(sent) - len(frame)))
        assert frame_in(frame + chance.randbytes(64)) == frame
    record = b"\xff" * 5 + b"\1\x0a"
    assert frame_in(record + bytes(9)) == record
    with pytest.raises(TransportError, match="a frame announces 105 bytes; the buffer has 64"):
        frame_in(pack_frame(0, bytes(100))[:64])


def test_a_system_that_accepts_nothing(driver: type[Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    with board(monkeypatch) as stand_in, driver() as overlay:
        stand_in.engine.is_held = True
        overlay.send("left", *[message(0)] * 16, timeout=60)
        with pytest.raises(TimeoutError, match="'left' did not accept message 0 within"):
            overlay.send("left", message(1), timeout=0.05)
        stand_in.engine.is_held = False
        overlay.send("left", message(1))
        assert overlay.receive_all(17)[-1] == ("left_out", message(1))


def test_broken_bursts_are_reported_and_the_next_ones_received(driver: type[Driver]) -> None:
    overlay = driver(transport=cast("EngineTransport", Bursts()))
    payload = overlay.publishers["left_out"].encode(message(5))
    bursts = Bursts(
        Burst(pack_frame(0, payload)),
        Burst(b"\1", is_aborted=True),
        Burst(pack_frame(2, payload)),
        Burst(pack_frame(1, payload[:7])),
        Burst(pack_frame(1, payload)),
    )
    overlay = driver(transport=cast("EngineTransport", bursts))
    assert overlay.receive() == ("left_out", message(5))
    with pytest.raises(AbortedFrameError, match="the frame with id 1 was aborted"):
        overlay.receive()
    with pytest.raises(BurstError, match="the id is 2, but the publishers are 0 to 1"):
        overlay.receive()
    with pytest.raises(CodecError):
        overlay.receive()
    assert overlay.receive() == ("right_out", message(5))


def test_wrong_messages_are_not_sent(driver: type[Driver]) -> None:
    bursts = Bursts()
    overlay = driver(transport=cast("EngineTransport", bursts))
    with pytest.raises(InputError, match="'lefd' is not a subscriber"):
        overlay.send("lefd", {})
    with pytest.raises(CodecError):
        overlay.send("left", message(0), {"point": {"x": "much"}})
    assert bursts.sent == []
    overlay.send("right", {})
    assert bursts.sent == [pack_frame(1, overlay.subscribers["right"].encode({}))]


def test_a_fault_of_the_engine(driver: type[Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    with board(monkeypatch) as stand_in, driver() as overlay:
        stand_in.engine.halt(MM2S, DMA_DECODE)
        with pytest.raises(TransportError, match="MM2S: DMADecErr"):
            overlay.send("left", message(0))


@pytest.mark.parametrize("name", ["sendchannel", "recvchannel"])
def test_a_fault_of_a_channel(driver: type[Driver], name: str) -> None:
    dma = SimpleDma()
    with driver.over(dma, np.zeros) as overlay:
        overlay.send("left", message(0))
        getattr(dma, name).error = True
        use: dict[str, Callable[[], object]] = {
            "sendchannel": partial(overlay.send, "left", message(0)),
            "recvchannel": overlay.receive,
        }
        with pytest.raises(TransportError, match="the DMA engine has failed: DMA Internal Error"):
            use[name]()


def test_frames_that_the_engine_of_a_user_cannot_transfer(driver: type[Driver]) -> None:
    with (
        driver.over(SimpleDma(buffer_max_size=255), np.zeros) as overlay,
        pytest.raises(TransportError, match="a frame has 249 bytes; the buffer has 192"),
    ):
        overlay.send("left", message(0, 200))


def test_a_closed_overlay(driver: type[Driver]) -> None:
    overlay = driver.over(SimpleDma(), np.zeros)
    overlay.close()
    overlay.close()
    assert overlay.receive() is None
    with pytest.raises(TransportError, match="the transport is closed"):
        overlay.send("left", {})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("width: 32", "width: 64"), "accepts 3 bytes after a message, and a beat has 8"),
        (lambda text: text.replace("ROS2", "ROS"), "accepts 0 bytes after a message, and a beat has 4"),
        (
            lambda text: text.replace("width: 32", "width: 32, scheduler: fixed_priority_preemptive"),
            "with a preemptive scheduler",
        ),
    ],
)
def test_systems_that_need_an_engine_with_tkeep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[str], str], message: str
) -> None:
    made = driver_of(written(tmp_path, text=change(SPECIFICATION)), monkeypatch)
    with pytest.raises(InputError, match=message):
        made.over(SimpleDma(), np.zeros, drives_tkeep=False)
    made.over(SimpleDma(), np.zeros).close()


def test_a_machine_without_pynq(driver: type[Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pynq", None)
    with pytest.raises(InputError, match="PYNQ cannot be imported"):
        driver()


@pytest.mark.parametrize("ending", [".bit", ".hwh"])
def test_a_missing_file(driver: type[Driver], monkeypatch: pytest.MonkeyPatch, ending: str) -> None:
    driver.BITSTREAM.with_suffix(ending).unlink()
    with board(monkeypatch) as stand_in, pytest.raises(InputError, match=rf"there is no file .*pair_zynq7000\{ending}"):
        driver()
    assert stand_in.loaded == []


def test_an_overlay_without_the_engine(driver: type[Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    with board(monkeypatch, name="axi_dma_0"), pytest.raises(InputError, match="the overlay has no 'dma'") as error:
        driver()
    assert "its IP: axi_dma_0, system" in str(error.value)


def test_memory_that_the_engine_does_not_reach(driver: type[Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.export.pynq.stand_in.Array.physical_address", 2**32 - 4096)
    with board(monkeypatch), pytest.raises(TransportError, match="the allocated memory ends beyond the 4 GiB"):
        driver()


def test_the_stand_in_finds_a_driver_that_breaks_a_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Board()
    made.engine.close()
    with pytest.raises(ValueError, match="Data type must be int"):
        made.pynq().MMIO(0x4040_0000, 0x10000).write(0, True)
