"""What is proved of cores/, and that a broken copy fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.proofs import document, smtbmc
from tools.proofs.all import PROOFS
from tools.proofs.proof import Mutation, MutationError, Proof
from tools.proofs.smtbmc import Task

needs_solver = pytest.mark.skipif(not smtbmc.is_installed(), reason="no yosys or z3-solver; make check installs them")

_SIZES = [pytest.param(proof, size, id=f"{proof.name}-{size}") for proof in PROOFS for size in proof.sizes]
_FAULTS = [(proof, mutation, label) for proof in PROOFS for mutation in proof.mutations for label in mutation.violates]


@pytest.mark.check
@needs_solver
@pytest.mark.parametrize(("proof", "size"), _SIZES)
def test_it_is_proved(proof: Proof, size: dict[str, int], tmp_path: Path) -> None:
    outcome = proof.prove(size, tmp_path)
    assert outcome.is_proved, outcome.log


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
