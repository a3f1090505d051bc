"""What is proved of cores/, and that a broken copy fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hdl.ghdl import CORES
from tools.proofs import document, memories, smtbmc
from tools.proofs.all import PROOFS
from tools.proofs.collisions import with_collisions
from tools.proofs.proof import Mutation, MutationError, Proof
from tools.proofs.smtbmc import Task

needs_solver = pytest.mark.skipif(not smtbmc.is_installed(), reason="no yosys or z3-solver; make check installs them")

_SIZES = [
    pytest.param(proof, size, id=f"{proof.name}-{size}", marks=[mark])
    for proof in PROOFS
    for mark, sizes in ((pytest.mark.check, proof.sizes), (pytest.mark.thorough, proof.long_sizes))
    for size in sizes
]
_FAULTS = [(proof, mutation, label) for proof in PROOFS for mutation in proof.mutations for label in mutation.violates]


@needs_solver
@pytest.mark.parametrize(("proof", "size"), _SIZES)
def test_it_is_proved(proof: Proof, size: dict[str, int], tmp_path: Path) -> None:
    outcome = proof.prove(size, tmp_path)
    assert outcome.is_proved, outcome.log


@pytest.mark.one_in(5, 5)
@pytest.mark.check
@needs_solver
@pytest.mark.parametrize(("proof", "mutation", "label"), _FAULTS, ids=[f"{p.name}-{label}" for p, _, label in _FAULTS])
def test_a_broken_copy_fails(proof: Proof, mutation: Mutation, label: str, tmp_path: Path) -> None:
    outcome = proof.search(mutation, label, tmp_path)
    assert outcome.failed == (label,), outcome.log


# A counter, and an assertion about it; the solver chooses nothing.
_COUNTER = """module counter (input clk);
reg [3:0] number = 0;
always @(posedge clk) number <= number + 1;
always @* assume (number < {assumed});
always @* is_low: assert (number < {asserted});
endmodule
"""


@pytest.mark.check
@needs_solver
@pytest.mark.parametrize(("asserted", "failed"), [(6, ()), (5, ("is_low",))])
def test_a_check_ends_with_its_last_cycle(asserted: int, failed: tuple[str, ...], tmp_path: Path) -> None:
    outcome = _counter(assumed=15, asserted=asserted).check(tmp_path, 6)
    assert (outcome.is_proved, outcome.failed) == (not failed, failed)


@pytest.mark.check
@needs_solver
@pytest.mark.parametrize(("assumed", "is_proved"), [(7, True), (6, False)])
def test_nothing_is_proved_where_no_trace_keeps_the_assumptions(assumed: int, is_proved: bool, tmp_path: Path) -> None:
    assert _counter(assumed=assumed, asserted=15).check(tmp_path, 6).is_proved == is_proved


def _counter(**limits: int) -> Task:
    return Task("counter.sv", {"counter.sv": _COUNTER.format(**limits), "netlist.v": ""})


@pytest.mark.parametrize("proof", PROOFS, ids=lambda proof: proof.name)
def test_every_property_has_its_mutation(proof: Proof) -> None:
    violated = [label for mutation in proof.mutations for label in mutation.violates]
    assert {*violated} == {*proof.properties}


def test_every_memory_without_collisions_is_proved() -> None:
    """Also, no other memory is declared as one."""
    declared = {file.stem for file in CORES.rglob("*.vhd") if b'signal is "no_rw_check"' in file.read_bytes()}
    assert declared == {proof.entity for proof in memories.PROOFS}


# A word of a memory that is written and read at the same address in each cycle.
_COLLIDING = """module ram (input clk, input d, output reg q);
  (* syn_ramstyle = "no_rw_check", rw_addr_collision = "no" *) reg memory[1:0] ; // memory
  always @(posedge clk)
      q <= memory[1'b0];
  always @(posedge clk)
    if (write)
      memory[1'b0] <= d;
  wire write = 1;
endmodule
"""
_READER = """module reader (input clk);
  reg after = 0;
  wire q;
  always @(posedge clk) after <= 1;
  ram dut (.clk(clk), .d(1'b0), .q(q));
  (* hierconn *) wire \\dut.collides ;
  always @* always_collides: assert (\\dut.collides );
  reg two = 0;
  always @(posedge clk) two <= after;
  always @* reads_zero: assert (!two || !q);
endmodule
"""


@pytest.mark.check
@needs_solver
def test_a_colliding_read_gives_any_word(tmp_path: Path) -> None:
    outcomes = {}
    for name, netlist in {
        "plain": _COLLIDING.replace("endmodule", "wire collides = 1;\nendmodule"),
        "free": with_collisions(_COLLIDING),
    }.items():
        folder = tmp_path / name
        folder.mkdir()
        outcomes[name] = Task("reader.sv", {"reader.sv": _READER, "netlist.v": netlist}).check(folder, 5).failed
    assert outcomes == {"plain": (), "free": ("reads_zero",)}


@pytest.mark.parametrize(
    ("file", "old"),
    [("firm_manager.vhd", "never written"), ("firm_manager.vhd", "signal"), ("firm_nothing.vhd", "entity")],
)
def test_a_mutation_must_find_its_text_once(file: str, old: str, tmp_path: Path) -> None:
    with pytest.raises(MutationError, match=file):
        PROOFS[0].search(Mutation(file, old, "", ("no_beat_lost",)), "no_beat_lost", tmp_path)


def test_the_document_holds_what_is_proved() -> None:
    tables = document.tables()
    for line in [*document.properties(), *(document.row(proof) for proof in PROOFS)]:
        assert line in tables, f"docs/figures/proofs.md has no row {line} `make proofs` writes it"
