"""Each correction of GHDL's synthesis is needed with the versions for which it is made, and GHDL is right without it
with the others."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from fusesoc_firm.netlist import translation
from fusesoc_firm.netlist.ghdl_faults import Fault, faults_at_hand, faults_of
from fusesoc_firm.netlist.model import Modules
from tests.netlist.comparison import differences
from tests.netlist.designs import Design
from tests.netlist.faults import COMPUTED, FAULTS, LOST, MIXED, RESTORED, growing

OF_VERSIONS = {
    Fault.LOST_CONSTANTS: [*LOST, *COMPUTED, *RESTORED],
    Fault.MIXED_CONSTANTS: [MIXED],
    Fault.GROWN_TABLES: [growing(2), growing(3)],
}
OF_ALL = {
    "numeric_std": [item for item in FAULTS if item.name.startswith(("subtracted", "narrowed", "product", "compared"))],
    "rotations": [item for item in FAULTS if item.name.startswith("rotated")],
}


@pytest.mark.parametrize(
    ("version", "faults"),
    [
        ("GHDL 2.0.0 (Debian 2.0.0+dfsg-6.2+b2) [Dunoon edition]", set(Fault)),
        ("GHDL 3.0.0 (v3.0.0) [Dunoon edition]", {Fault.MIXED_CONSTANTS}),
        ("GHDL 5.0.1 (Debian 5.0.1+dfsg-1+b1) [Dunoon edition]", set()),
        ("GHDL 10.2 [Dunoon edition]", set()),
        ("ghdl", set(Fault)),
        ("", set(Fault)),
    ],
)
def test_a_version_has_the_faults_that_were_not_mended_before(version: str, faults: set[Fault]) -> None:
    assert faults_of(version) == faults


def wrong_ones(designs: Sequence[Design]) -> list[str]:
    return [found.design.name for found in differences(designs, ["icarus"])]


def no_longer_needed(what: str) -> None:
    pytest.skip(f"the installed GHDL needs no correction of {what}")


@pytest.mark.parametrize("fault", Fault)
def test_without_corrections_ghdl_is_right_unless_its_version_has_the_fault(
    fault: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    has_fault = fault in faults_at_hand()
    monkeypatch.setattr(translation, "faults_at_hand", frozenset)
    monkeypatch.setattr(translation, "_PADDINGS", (0,))
    wrong = wrong_ones(OF_VERSIONS[fault])
    assert has_fault or not wrong
    if has_fault and not wrong:
        no_longer_needed(fault.name)


@pytest.mark.parametrize("correction", OF_ALL)
def test_all_versions_need_the_other_corrections(correction: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def correct(_modules: Modules) -> None:
        """Correct nothing."""

    monkeypatch.setattr(translation, "use_numbers", lambda _files: False)
    monkeypatch.setattr(translation, "correct", correct)
    designs = OF_ALL[correction]
    if right := {item.name for item in designs} - set(wrong_ones(designs)):
        no_longer_needed(", ".join(sorted(right)))
