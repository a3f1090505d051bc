"""The status's registers and counters against their description: every register, through AXI4-Lite with stalls."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.system.hardware.registers import Kind, Register, registers_configuration
from fusesoc_firm.system.hardware.status import REGISTERS_TEMPLATE, Features, Part, status_map
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import Library, core_files
from tests.hdl.verilog import netlist
from tests.recall import RunResult

BENCH = "status_bench"
DIGEST = "0123456789abcdef" * 2
SIGNATURES = ("deadbeef", "00c0ffee", "12345678")
MAP = status_map("bench", 2, 1, DIGEST, Features(Part.TIME_STAMPS))
# The registers that change by themselves.
RESTING = [register for register in MAP.registers if register.name != "cycles"]
COUNT_BITS = 4
CHANNELS = ("subscriber[0]", "subscriber[1]", "publisher[0]")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder = tmp_path_factory.mktemp("status")
    registers = folder / "bench_status.vhd"
    registers.write_text(render(REGISTERS_TEMPLATE, registers_configuration(MAP, SIGNATURES)))
    library = Library("firm", folder)
    library.analyse([*core_files("axis/package", "axis/axis", "sched/package", "status/status"), registers])
    library.analyse([Path(__file__).with_name(name) for name in ("status_bench.vhd", "status_tree_bench.vhd")])
    return library


class Script:
    """Lines for the bench."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def act(self, action: str, first: int, second: int) -> None:
        self.lines.append(f"{action} {first:08x} {second:08x}\n")

    def read(self, name: str, word: int) -> None:
        self.act("r", MAP.by_name[name].address, word)

    def write(self, name: str, word: int) -> None:
        self.act("w", MAP.by_name[name].address, word)

    def run(self, library: Library, folder: Path, seed: int = 1) -> RunResult:
        (folder / "script.txt").write_text("".join(self.lines))
        options = ("--ieee-asserts=disable-at-0", "--assert-level=failure")
        result = library.run(BENCH, {"SEED": seed, "COUNT_BITS": COUNT_BITS}, directory=folder, options=options)
        assert result.exit_code == 0, f"seed {seed}: {result.output}"
        assert f"PASS {len(self.lines)}" in result.output
        return result


def at_reset(register: Register) -> int:
    """The word of a register after reset, before anything has happened."""
    if register.name.endswith(".signature"):
        return int(SIGNATURES[CHANNELS.index(register.name.removesuffix(".signature"))], 16)
    return sum(field.reset << field.low for field in register.fields)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.check)])
def test_every_register_has_its_reset_value_and_its_access(library: Library, tmp_path: Path, seed: int) -> None:
    script = Script()
    for register in RESTING:
        script.read(register.name, at_reset(register))
    for register in RESTING:
        script.write(register.name, 0xFFFFFFFF)
        stored = sum((1 << f.width) - 1 << f.low for f in register.fields if f.kind is Kind.STORAGE)
        constant = sum(f.reset << f.low for f in register.fields if f.kind is not Kind.STORAGE)
        script.read(register.name, at_reset(register) if register.is_external else stored | constant)
        script.act("h", register.address, 0)
        script.read(register.name, at_reset(register) if register.is_external else stored | constant)
        script.write(register.name, at_reset(register))
        script.read(register.name, at_reset(register))
    # A reserved address.
    script.act("r", 0x40, 0)
    script.act("r", 0x80C4, 0)
    script.run(library, tmp_path, seed)


def test_a_written_one_clears_an_interrupt_and_a_zero_does_not(library: Library, tmp_path: Path) -> None:
    script = Script()
    script.act("i", 1, 0)
    script.act("i", 1, 1)
    script.read("interrupt", 0b0110)
    script.act("q", 0, 0)
    script.write("interrupt_enable", 0b0100)
    script.act("q", 0, 1)
    script.write("interrupt", 0b0010)
    script.read("interrupt", 0b0100)
    script.act("q", 0, 1)
    script.write("interrupt", 0b1011)
    script.read("interrupt", 0b0100)
    script.write("interrupt", 0b0100)
    script.read("interrupt", 0)
    script.act("q", 0, 0)
    script.run(library, tmp_path)


def test_counters_stop_at_their_highest_value(library: Library, tmp_path: Path) -> None:
    script = Script()
    script.act("i", 65534, 0)
    script.read("id_errors", 65534)
    script.act("i", 2, 0)
    script.read("id_errors", 65535)
    script.read("link_errors", 0)
    for count in range(1, 2**COUNT_BITS + 2):
        script.act("f", 1, 3)
        script.act("s", 2, 0)
        script.read("subscriber[1].faults[2]", min(count, 2**COUNT_BITS - 1))
        script.read("publisher[0].frames", min(count, 2**COUNT_BITS - 1))
    script.run(library, tmp_path)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.check)])
def test_time_stamps_are_the_cycles_of_beats(library: Library, tmp_path: Path, seed: int) -> None:
    print(f"seed {seed}")
    source, script = random.Random(seed), Script()
    for _ in range(60):
        script.act("m", source.randrange(3), source.choice([1, 2, 5]))
        script.act("c", 0, 0)
        for channel in range(3):
            script.act("t", channel, 0)
    # Frames of one beat, one after the other.
    for channel in (0, 1, 2, 2, 0):
        script.act("s", channel, 0)
    for channel in range(3):
        script.act("t", channel, 0)
    script.run(library, tmp_path, seed)


def test_faults_frames_and_waits_are_counted_in_their_channels(library: Library, tmp_path: Path) -> None:
    script = Script()
    for channel, name in enumerate(CHANNELS):
        for code in range(1, 13):
            script.act("f", channel, code)
            script.read(f"{name}.faults[{code - 1}]", 1)
        script.read("last_fault", channel << 4 | 12)
        for wait in (0, 7, 3):
            script.act("s", channel, wait)
        script.read(f"{name}.frames", 3)
        script.read(f"{name}.longest_wait", 7)
    # Two channels in the same cycle, twice in a row, and a channel that has two at once.
    script.act("b", 0, 5)
    script.act("q", 0, 0)
    script.act("b", 1, 5)
    script.act("q", 0, 0)
    script.read("subscriber[0].faults[4]", 2)
    script.read("subscriber[1].faults[4]", 3)
    script.read("publisher[0].faults[4]", 2)
    script.read("lost", 0)
    # The second publisher's fault waits for the two below it.
    script.act("b", 1, 6)
    script.act("f", 2, 6)
    script.read("publisher[0].faults[5]", 2)
    script.read("lost", 1)
    script.read("interrupt", 0b1001)
    script.write("control", 0)
    script.act("f", 0, 1)
    script.act("s", 0, 100)
    script.read("subscriber[0].faults[0]", 1)
    script.read("subscriber[0].frames", 3)
    script.run(library, tmp_path)


def test_a_counter_is_zero_after_a_second_reset_before_it_is_cleared(library: Library, tmp_path: Path) -> None:
    """The last word of the table of faults is cleared last, in the 64th cycle; it is read in about the twentieth."""
    script = Script()
    script.act("f", 2, 12)
    script.read("publisher[0].faults[11]", 1)
    script.act("z", 0, 0)
    script.read("publisher[0].faults[11]", 0)
    script.run(library, tmp_path)


@pytest.mark.parametrize("is_crowded", [False, True])
@pytest.mark.parametrize(
    ("subscribers", "publishers"), [(3, 5), (1, 1), (2, 3), pytest.param(9, 40, marks=pytest.mark.check)]
)
def test_the_counters_beside_a_tree(library: Library, subscribers: int, publishers: int, is_crowded: bool) -> None:
    for seed in (1, 2):
        print(f"seed {seed}")
        generics = {"SUBSCRIBERS": subscribers, "PUBLISHERS": publishers, "SEED": seed, "CROWDED": is_crowded}
        options = ("--ieee-asserts=disable-at-0", "--assert-level=failure")
        result = library.run("status_tree_bench", generics, options=options)
        assert result.exit_code == 0 and "PASS" in result.output, result.output


def test_reserved_addresses_beside_a_tree_read_zero(tmp_path: Path) -> None:
    configuration = registers_configuration(status_map("wide", 2, 1, DIGEST), SIGNATURES, 20)
    registers = tmp_path / "wide_status.vhd"
    registers.write_text(render(REGISTERS_TEMPLATE, configuration))
    known = [(0x8000 + 0x40 * channel, signature) for channel, signature in enumerate(SIGNATURES)]
    known += [(address + 4, "ffffffff") for address, _ in known]
    reserved = [0x80C0, 0x80C4, 0x8100, 0x8104, 0x47FC0, 0x48000, 0x48004, 0x880C4, 0xFFFFC]
    rows = [*known, *((address, "00000000") for address in reserved)]
    (tmp_path / "script.txt").write_text("".join(f"{address:05x} {word}\n" for address, word in rows))
    library = Library("firm", tmp_path)
    library.analyse([registers, Path(__file__).with_name("status_registers_bench.vhd")])
    result = library.run("status_registers_bench", options=("--ieee-asserts=disable-at-0", "--assert-level=error"))
    assert result.exit_code == 0 and f"PASS {len(rows)}" in result.output, result.output


def test_too_many_bits_of_an_address_are_refused(library: Library) -> None:
    result = library.run("firm_status_frames", {"ADDRESS_BITS": 32})
    assert result.exit_code != 0
    assert "firm_status_frames: ADDRESS_BITS is 32; legal: 1 to 31" in result.output


def test_too_many_channels_are_named(library: Library) -> None:
    result = library.run("firm_status_tree_counters", {"SUBSCRIBERS": 4000, "PUBLISHERS": 97})
    assert result.exit_code != 0
    assert "SUBSCRIBERS is 4000 and PUBLISHERS is 97; legal: 1 or more each, and at most 4096 together" in result.output


@pytest.mark.parametrize("entity", ["firm_status_tree_counters", "firm_status_waits", "firm_status_faults"])
def test_the_parts_beside_a_tree_are_latch_free(library: Library, entity: str) -> None:
    assert library.latches(entity, {}) == []


@pytest.mark.parametrize("sources", [1, 3])
def test_waits_of_any_number_of_sources_have_a_netlist(tmp_path: Path, sources: int) -> None:
    """Each bit has an assignment: GHDL drops others with a warning, which ends the translation."""
    files = core_files("axis/package", "axis/axis", "sched/package", "status/status")
    assert netlist("firm.firm_status_waits", tmp_path, [], files, SOURCES=sources).exists()
