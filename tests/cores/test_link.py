"""The links of boards without a processor: frames over UART and SPI and back, and the handling of faults."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from pathlib import Path

import pytest

from tests.hdl.frames import Frame, random_frames, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Generic, GhdlError, Library, core_files
from tests.links import coded, decoded, faulty_row
from tests.seeds import seeded

SEED = seeded(20261121)
LINKS = ("uart", "spi")
WIDTHS = [8, 16, 64]
# Cycles of the bench: per bit, and per byte on the line.
BIT = 10
UART_BYTE = 10 * BIT
FAULTS = Path(__file__).with_name("link_faults.vhd")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("link"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(
        core_files(
            "axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "sim/link", "cdc/sync", "board/link"
        )
    )
    library.analyse([*core_files("board/link", fileset="tb"), FAULTS])
    return library


def _write_files(directory: Path, number: int, longest: int, seed: int = SEED) -> int:
    """Frames with payloads of 0 to `longest` bytes; all their bytes on the link."""
    return _write_frames(directory, random_frames(range(256), number, longest, seed))


def _write_frames(directory: Path, frames: Sequence[Frame]) -> int:
    write_stimulus(directory / "stimulus.txt", (frame.to_bytes() for frame in frames))
    write_expected(directory / "expected.txt", ((n, frame.to_bytes()) for n, frame in enumerate(frames)))
    return sum(len(coded(frame.to_bytes())) for frame in frames)


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("stall", [0, 30])
def test_frames_come_back_as_they_were(library: Library, tmp_path: Path, link: str, width: int, stall: int) -> None:
    _write_files(tmp_path, 15, 100)
    generics: dict[str, Generic] = {"LINK": link, "WIDTH": width, "SEED": SEED, "STALL_PERCENT": stall}
    result = library.run("firm_link_tb", generics, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS 15/15"


def test_blocks_of_full_length_come_back(library: Library, tmp_path: Path) -> None:
    """A block of COBS has at most 254 bytes without a zero; here frames have 253, 254 and more of them."""
    sizes = (249, 250, 251, 504, 505)
    frames = [Frame(7, bytes([size % 255 + 1]) * size) for size in sizes]
    codes = [len(coded(frame.to_bytes())) - size for frame, size in zip(frames, sizes, strict=True)]
    assert codes == [11, 11, 12, 12, 13]
    _write_frames(tmp_path, frames)
    result = library.run("firm_link_tb", {"LINK": "spi", "LONGEST": max(sizes)}, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == f"PASS {len(frames)}/{len(frames)}"


def test_uart_wastes_no_bit(library: Library, tmp_path: Path) -> None:
    """Between the bytes of both directions is nothing but what the simulated adapter takes to fetch the next one.

    The last frame comes back after it has gone there.
    """
    longest = 300
    size = _write_files(tmp_path, 10, longest)
    result = library.run("firm_link_tb", {"LONGEST": longest}, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert traffic(result.output).cycles < (size + longest + 15) * (UART_BYTE + 2) + 5 * UART_BYTE + 200


@pytest.mark.parametrize("error", [-20, 20])
def test_uart_reads_a_host_whose_clock_is_wrong(library: Library, tmp_path: Path, error: int) -> None:
    _write_files(tmp_path, 10, 60)
    generics: dict[str, Generic] = {"CLOCK_ERROR": error, "SEED": SEED}
    result = library.run("firm_link_tb", generics, directory=tmp_path)
    assert result.exit_code == 0, result.output


@pytest.mark.one_in(2)
@pytest.mark.parametrize("link", LINKS)
def test_the_netlist_of_a_link_does_the_same(tmp_path: Path, link: str) -> None:
    library = _library(tmp_path)
    generics: dict[str, Generic] = {"WIDTH": 32, "LONGEST": 120}
    if link == "spi":
        generics["DEPTH"] = 512
    else:
        generics |= {"CLOCK_HZ": 100_000_000, "BAUD": 10_000_000}
    assert library.latches(f"firm_{link}_link", generics) == []
    library.replace_by_netlist(f"firm_{link}_link", generics)
    # The netlist has parts of the same names as the other link's: that one must not look for its own.
    library.analyse([_without_content(tmp_path, next(other for other in LINKS if other != link))])
    library.analyse(core_files("board/link", fileset="tb"))
    _write_files(tmp_path, 10, 60)
    bench: dict[str, Generic] = {"LINK": link, "WIDTH": 32, "SEED": SEED, "STALL_PERCENT": 30}
    result = library.run("firm_link_tb", bench)
    assert result.exit_code == 0, result.output


def _without_content(directory: Path, link: str) -> Path:
    """The entity of a link, with nothing in it."""
    entity = f"firm_{link}_link"
    (source,) = [file for file in core_files("board/link") if file.stem == entity]
    text, _, _ = source.read_text(encoding="ascii").partition("architecture")
    file = directory / f"{entity}_empty.vhd"
    file.write_text(f"{text}architecture empty of {entity} is begin end;\n", encoding="ascii")
    return file


# --- a script on the line ----------------------------------------------------------------------------------------


def _frame(payload: bytes, id_: int = 7) -> bytes:
    return bytes([id_]) + len(payload).to_bytes(4, "little") + payload


def _bytes(data: bytes) -> list[str]:
    return [f"byte   {byte}" for byte in data]


def _played(library: Library, directory: Path, script: list[str], **generics: int) -> list[str]:
    (directory / "script.txt").write_text("".join(f"{line}\n" for line in script), encoding="ascii")
    result = library.run("firm_uart_script_tb", generics, directory=directory)
    assert result.exit_code == 0, result.output
    return result.output.split()


WHOLE = _frame(b"\xab\x00\xef")
CODED = coded(WHOLE)
BREAK = ["break  0"]
BROKEN = ["error", "12"]


@pytest.mark.one_in(9, 3)
@pytest.mark.parametrize("width", [8, 16, 64])
@pytest.mark.parametrize("sent", range(len(CODED)))
def test_a_break_drops_a_frame_that_has_begun(library: Library, tmp_path: Path, width: int, sent: int) -> None:
    script = [*_bytes(CODED), *_bytes(CODED[:sent]), *BREAK, *_bytes(CODED)]
    assert _played(library, tmp_path, script, WIDTH=width) == [WHOLE.hex(), *(BROKEN if sent else []), WHOLE.hex()]


def test_a_pause_is_no_fault(library: Library, tmp_path: Path) -> None:
    script = [*_bytes(CODED[:6]), "pause  500", *_bytes(CODED[6:])]
    assert _played(library, tmp_path, script) == [WHOLE.hex()]


@pytest.mark.one_in(4, 3)
@pytest.mark.parametrize("place", range(len(CODED)))
def test_a_low_stop_bit_costs_its_frame(library: Library, tmp_path: Path, place: int) -> None:
    """And the next one if it was in the zero between them."""
    script = [*_bytes(CODED[:place]), "wrong  85", *_bytes(CODED[place + 1 :]), *_bytes(CODED), *_bytes(CODED)]
    rest = [WHOLE.hex()] * (1 if place == len(CODED) - 1 else 2)
    assert _played(library, tmp_path, script) == [*BROKEN, *rest]


def test_a_glitch_is_no_byte(library: Library, tmp_path: Path) -> None:
    script = [line for byte in _bytes(CODED) for line in ("glitch 0", byte)]
    assert _played(library, tmp_path, script) == [WHOLE.hex()]


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(3))
def test_a_frame_that_finds_no_room_is_dropped(library: Library, tmp_path: Path, seed: int) -> None:
    """The system stalls while more arrives than fits; each frame arrives or is reported."""
    print(f"seed {seed}")
    random_ = random.Random(seed)
    frames = [_frame(random_.randbytes(random_.randrange(40)), number) for number in range(12)]
    script = ["system 0", *(line for frame in frames for line in _bytes(coded(frame)))]
    script += ["system 1", "pause  20", *_bytes(CODED)]
    got = [line for line in _played(library, tmp_path, script) if line not in ("no", "room", "12")]
    *some, last = [line for line in got if line != "error"]
    assert last == WHOLE.hex()
    assert some == [frame.hex() for frame in frames if frame.hex() in some]
    assert len(got) == len(frames) + 1 and "error" in got
    assert 60 <= len("".join(some)) // 2 <= 130


def test_the_host_is_asked_to_wait_in_time(library: Library, tmp_path: Path) -> None:
    """The ring has 128 bytes: the host is asked to wait when 32 are left, and never for a frame alone."""
    frame = _frame(bytes(64))
    script = ["system 0", *_bytes(coded(frame)), "system 1", *_bytes(coded(frame))]
    assert "no" not in _played(library, tmp_path, script)
    script = ["system 0", *_bytes(coded(frame)), *_bytes(coded(frame)[:50]), "system 1", *_bytes(coded(frame)[50:])]
    assert _played(library, tmp_path, script) == ["no", "room", frame.hex(), frame.hex()]


# --- faults --------------------------------------------------------------------------------------------------------

COUNTS = ("good", "broken", "lost", "refused", "code_12", "code_7")


def _received(
    library: Library, directory: Path, numbers: Iterable[int], **generics: Generic
) -> tuple[list[bytes], dict[str, int]]:
    """The frames that arrive of these bytes, losses (-1) and cuts (-2), and the link's counts."""
    (directory / "bytes.txt").write_text("".join(f"{number}\n" for number in numbers), encoding="ascii")
    result = library.run("link_faults", generics, directory=directory, seconds=3000)
    assert result.exit_code == 0, result.output
    words = [line.split() for line in result.output.splitlines() if line]
    counts = {name: int(rest[0]) for name, *rest in words if name in COUNTS}
    return [bytes.fromhex(line) for line, *rest in words if not rest], counts


@pytest.mark.parametrize(
    ("width", "faults"),
    [(8, 500), pytest.param(64, 500, marks=pytest.mark.check), pytest.param(8, 100_000, marks=pytest.mark.thorough)],
)
def test_a_fault_costs_its_frame_and_at_most_the_next(
    library: Library, tmp_path: Path, width: int, faults: int
) -> None:
    row = faulty_row(faults, 40, SEED)
    received, counts = _received(library, tmp_path, row.data, WIDTH=width, SEED=SEED)
    row.check(received)
    expected = [*decoded(row.data)]
    broken = expected.count(None)
    assert received == [frame for frame in expected if frame is not None]
    assert counts == dict(zip(COUNTS, (len(received), broken, 0, 0, broken, 0), strict=True))


def test_faults_are_counted_by_their_kind(library: Library, tmp_path: Path) -> None:
    longest, too_long = _frame(bytes(100)), _frame(bytes(101))
    short = coded(WHOLE[:-1])
    row = [*coded(longest), *coded(too_long), *coded(WHOLE), 0, 0, *CODED[:5], -1, *CODED[6:], *CODED, *CODED[:4], -2]
    row += [*CODED, *short, *coded(WHOLE + b"\0"), *CODED[:3], 0, 2, 0, *CODED]
    received, counts = _received(library, tmp_path, row)
    assert received == [longest, *[WHOLE] * 4]
    assert counts == dict(zip(COUNTS, (5, 4, 2, 1, 6, 1), strict=True))


def test_a_frame_that_finds_no_room_counts_as_lost(library: Library, tmp_path: Path) -> None:
    frames = [_frame(bytes([number]) * 90) for number in range(20)]
    row = [byte for frame in frames for byte in coded(frame)]
    received, counts = _received(library, tmp_path, row, STALL_PERCENT=90, HAS_FLOW_CONTROL=False)
    assert received == [frame for frame in frames if frame in received]
    assert (counts["good"], counts["lost"]) == (len(received), 20 - len(received))
    assert counts["lost"] > 0


@pytest.mark.parametrize(
    ("entity", "generics", "legal"),
    [
        ("firm_uart_link", {"BAUD": 30_000_000}, "1 to a quarter of CLOCK_HZ"),
        ("firm_uart_link", {"BAUD": 0}, "1 to a quarter of CLOCK_HZ"),
        ("firm_uart_link", {"CLOCK_HZ": 12_000_000, "BAUD": 2_600_000}, "off by more than 2.5 %"),
        ("firm_uart_link", {"LONGEST": 0}, "1 to 1048576"),
        ("firm_uart_link", {"WIDTH": 24}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_spi_link", {"DEPTH": 256}, "a power of two from 512 to 32768"),
        ("firm_spi_link", {"DEPTH": 1000}, "a power of two from 512 to 32768"),
    ],
)
def test_bad_generics_stop_with_what_is_legal(
    library: Library, entity: str, generics: dict[str, Generic], legal: str
) -> None:
    with pytest.raises(GhdlError, match=legal):
        library.synthesise(entity, generics)
