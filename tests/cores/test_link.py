"""The links of boards without a processor: frames over UART and SPI and back, and the handling of faults."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.hdl.frames import random_frames, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Generic, GhdlError, Library, core_files

SEED = 20261121
LINKS = ("uart", "spi")
WIDTHS = [8, 16, 64]
# Cycles of the bench: per bit, and per byte on the line.
BIT = 10
UART_BYTE, SPI_BYTE = 10 * BIT, 8 * BIT
# Bits of silence after which a frame that has begun is over (1 ms at 125,000 baud).
SILENCE = 125


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("link"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/host", "sim/parts", "sim/link", "board/link"))
    library.analyse(core_files("board/link", fileset="tb"))
    return library


def _write_files(directory: Path, number: int, longest: int, seed: int = SEED) -> int:
    """Frames with payloads of 0 to `longest` bytes; all their bytes."""
    frames = random_frames(range(256), number, longest, seed)
    write_stimulus(directory / "stimulus.txt", (frame.to_bytes() for frame in frames))
    write_expected(directory / "expected.txt", ((n, frame.to_bytes()) for n, frame in enumerate(frames)))
    return sum(len(frame.to_bytes()) for frame in frames)


@pytest.mark.one_in(5)
@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("stall", [0, 30])
def test_frames_come_back_as_they_were(library: Library, tmp_path: Path, link: str, width: int, stall: int) -> None:
    _write_files(tmp_path, 15, 100)
    generics: dict[str, Generic] = {"LINK": link, "WIDTH": width, "SEED": SEED, "STALL_PERCENT": stall}
    result = library.run("firm_link_tb", generics, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS 15/15"


def test_uart_wastes_no_bit(library: Library, tmp_path: Path) -> None:
    """Between the bytes of both directions is nothing but what the simulated adapter takes to fetch the next one."""
    size = _write_files(tmp_path, 20, 100)
    result = library.run("firm_link_tb", {"DEPTH": 4096}, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert traffic(result.output).cycles < size * (UART_BYTE + 2) + 5 * UART_BYTE + 200


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
    generics: dict[str, Generic] = {"WIDTH": 32, "DEPTH": 64}
    if link == "uart":
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


WHOLE = _frame(b"\xab\xcd\xef")
BREAK = ["break  0"]
PAUSE = [f"pause  {SILENCE + 20}"]


@pytest.mark.one_in(13)
@pytest.mark.parametrize("width", [8, 16, 64])
@pytest.mark.parametrize("cut", [BREAK, PAUSE])
@pytest.mark.parametrize("sent", range(len(WHOLE)))
def test_a_cut_ends_a_frame_that_has_begun(
    library: Library, tmp_path: Path, width: int, cut: list[str], sent: int
) -> None:
    script = [*_bytes(WHOLE), *_bytes(WHOLE[:sent]), *cut, *_bytes(WHOLE)]
    begun = [WHOLE[:sent].hex()] if sent else []
    assert _played(library, tmp_path, script, WIDTH=width) == [WHOLE.hex(), *begun, WHOLE.hex()]


def test_a_short_pause_is_none(library: Library, tmp_path: Path) -> None:
    script = [*_bytes(WHOLE[:6]), f"pause  {SILENCE - 20}", *_bytes(WHOLE[6:])]
    assert _played(library, tmp_path, script) == [WHOLE.hex()]


@pytest.mark.parametrize("clear", [BREAK, PAUSE])
def test_behind_a_wrong_byte_nothing_counts_until_the_host_makes_itself_clear(
    library: Library, tmp_path: Path, clear: list[str]
) -> None:
    script = [*_bytes(WHOLE[:6]), "wrong  85", *_bytes(WHOLE), *_bytes(WHOLE), *clear, *_bytes(WHOLE)]
    assert _played(library, tmp_path, script) == ["error", WHOLE[:6].hex(), WHOLE.hex()]


def test_a_glitch_is_no_byte(library: Library, tmp_path: Path) -> None:
    script = [line for byte in _bytes(WHOLE) for line in ("glitch 0", byte)]
    assert _played(library, tmp_path, script) == [WHOLE.hex()]


@pytest.mark.one_in(3)
@pytest.mark.parametrize("clear", [BREAK, PAUSE])
@pytest.mark.parametrize("seed", range(3))
def test_what_finds_no_room_is_dropped_and_cut(library: Library, tmp_path: Path, clear: list[str], seed: int) -> None:
    """The system stalls while more arrives than fits: complete frames, then one that is cut, then complete ones."""
    print(f"seed {seed}")
    random_ = random.Random(seed)
    frames = [_frame(random_.randbytes(random_.randrange(20)), number) for number in range(12)]
    script = ["system 0", *(line for frame in frames for line in _bytes(frame)), *clear]
    script += ["system 1", "pause  20", *_bytes(WHOLE)]
    *got, last = [line for line in _played(library, tmp_path, script) if line not in ("no", "room")]
    assert got.pop(0) == "error"
    assert last == WHOLE.hex()
    *whole, cut = got
    assert whole == [frame.hex() for frame in frames[: len(whole)]]
    assert frames[len(whole)].hex().startswith(cut)
    assert 60 <= len("".join(got)) // 2 <= 68


def test_the_host_is_asked_to_wait_in_time(library: Library, tmp_path: Path) -> None:
    script = ["system 0", *_bytes(_frame(bytes(40))[:28]), "system 1", *_bytes(_frame(bytes(40))[28:])]
    assert "no" not in _played(library, tmp_path, script)
    script[29:29] = _bytes(bytes(8))
    assert "no" in _played(library, tmp_path, [*script, *BREAK])


@pytest.mark.parametrize(
    ("entity", "generics", "legal"),
    [
        ("firm_uart_link", {"BAUD": 30_000_000}, "1 to a quarter of CLOCK_HZ"),
        ("firm_uart_link", {"BAUD": 0}, "1 to a quarter of CLOCK_HZ"),
        ("firm_uart_link", {"CLOCK_HZ": 12_000_000, "BAUD": 2_600_000}, "off by more than 2.5 %"),
        ("firm_uart_link", {"TIMEOUT_MS": 0}, "1 to 4000"),
        ("firm_uart_link", {"DEPTH": 63}, "64 or more"),
        ("firm_uart_link", {"WIDTH": 24}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_spi_link", {"DEPTH": 8}, "16 to 32768"),
        ("firm_spi_link", {"DEPTH": 65536}, "16 to 32768"),
    ],
)
def test_bad_generics_stop_with_what_is_legal(
    library: Library, entity: str, generics: dict[str, Generic], legal: str
) -> None:
    with pytest.raises(GhdlError, match=legal):
        library.synthesise(entity, generics)
