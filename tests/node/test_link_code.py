"""Frames on links in Python, C++ and C, beside the package `cobs` and zlib."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

import pytest

from fusesoc_firm.node.transport.link_code import LinkDecoder, encode
from tests.hdl.frames import Frame
from tests.links import coded, decoded, faulty_row
from tests.node.drivers import Driver, compile_c_driver, cpp_driver
from tests.seeds import seeded

SEED = seeded(20261123)
_PIECE_BYTES = 20_000

Encode = Callable[[Sequence[bytes]], list[bytes]]
# Broken frames are None.
Decode = Callable[[bytes], list[bytes | None]]


@pytest.fixture(scope="module", params=["python", "cpp", "c"])
def codec(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Encode, Decode]:
    if request.param == "python":
        return lambda frames: [encode(frame) for frame in frames], _decode_in_python
    if request.param == "cpp":
        driver = cpp_driver("link")
    else:
        driver = compile_c_driver(
            "link", tmp_path_factory.mktemp("link"), ["firm/firm_frame.c", "firm/firm_link.c"], [], {}
        )
    return (lambda frames: _encode(driver, frames), lambda data: _decode(driver, data))


def _decode_in_python(data: bytes) -> list[bytes | None]:
    decoder = LinkDecoder()
    found = [frame for start in range(0, len(data), 777) for frame in decoder.push(data[start : start + 777])]
    assert decoder.counts.good == len(found) - found.count(None)
    assert decoder.counts.broken == found.count(None)
    return found


def _encode(driver: Driver, frames: Sequence[bytes]) -> list[bytes]:
    return [bytes.fromhex(answer) for answer in driver.answers([f"encode {frame.hex()}" for frame in frames])]


def _decode(driver: Driver, data: bytes) -> list[bytes | None]:
    starts = range(0, len(data), _PIECE_BYTES)
    answers = driver.answers([f"decode {data[start : start + _PIECE_BYTES].hex()}" for start in starts])
    return [None if word == "-" else bytes.fromhex(word) for answer in answers for word in answer.split()]


def test_frames_are_coded_alike(codec: tuple[Encode, Decode]) -> None:
    """Of all lengths around the longest blocks, with many zeros and without any."""
    print(f"seed {SEED}")
    source = random.Random(SEED)
    choices = [range(256), range(1, 256), (0, 1), (0,), (7,)]
    sizes = [*range(20), *range(240, 265), *range(495, 520), 5000]
    frames = [Frame(7, bytes(source.choices(items, k=size))).to_bytes() for size in sizes for items in choices]
    send, receive = codec
    expected = [coded(frame) for frame in frames]
    assert send(frames) == expected
    assert receive(b"\0".join(expected)) == frames


@pytest.mark.parametrize("faults", [2000, pytest.param(100_000, marks=pytest.mark.check)])
def test_a_fault_costs_its_frame_and_at_most_the_next(codec: tuple[Encode, Decode], faults: int) -> None:
    row = faulty_row(faults, 40, SEED)
    found = codec[1](row.data)
    row.check([frame for frame in found if frame is not None])
    assert found == [*decoded(row.data)]


def test_the_rest_of_a_frame_is_not_told(codec: tuple[Encode, Decode]) -> None:
    """Bytes before the first zero are a frame only if they are whole."""
    frame = Frame(1, b"abc").to_bytes()
    assert codec[1](coded(frame)[3:] + coded(frame)[:4] + b"\0" + coded(frame)) == [None, frame]
    assert codec[1](coded(frame)) == [frame]
