"""Each correction of GHDL's synthesis is needed with the versions for which it is made, and with no others."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from fusesoc_firm.netlist import ghdl2, translation
from fusesoc_firm.netlist.model import Modules
from tests.netlist.comparison import differences
from tests.netlist.designs import Design
from tests.netlist.faults import COMPUTED, FAULTS, LOST, MIXED, RESTORED, growing

OF_GHDL2 = {
    "lost constants": [*LOST, *COMPUTED, *RESTORED],
    "mixed constants": [MIXED],
    "grown tables": [growing(2), growing(3)],
}
OF_ALL = {
    "numeric_std": [item for item in FAULTS if item.name.startswith(("subtracted", "narrowed", "product", "compared"))],
    "rotations": [item for item in FAULTS if item.name.startswith("rotated")],
}


@pytest.mark.parametrize(
    ("version", "has_faults"),
    [
        ("GHDL 2.0.0 (Debian 2.0.0+dfsg-6.2+b2) [Dunoon edition]", True),
        ("GHDL 3.0.0 (tarball) [Dunoon edition]", False),
        ("GHDL 5.0.1 (Debian 5.0.1+dfsg-1+b1) [Dunoon edition]", False),
        ("GHDL 10.2 [Dunoon edition]", False),
        ("ghdl", True),
        ("", True),
    ],
)
def test_versions_from_3_on_do_not_have_the_faults(version: str, has_faults: bool) -> None:
    assert ghdl2.has_faults(version) == has_faults


def wrong_ones(designs: Sequence[Design]) -> list[str]:
    return [found.design.name for found in differences(designs, ["icarus"])]


def no_longer_needed(what: str) -> None:
    pytest.skip(f"the installed GHDL needs no correction of {what}")


@pytest.mark.parametrize("fault", OF_GHDL2)
def test_without_corrections_only_ghdl_2_is_wrong(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    has_faults = ghdl2.is_at_hand()
    monkeypatch.setattr(ghdl2, "is_at_hand", lambda: False)
    monkeypatch.setattr(translation, "_PADDINGS", (0,))
    wrong = wrong_ones(OF_GHDL2[fault])
    assert has_faults or not wrong
    if has_faults and not wrong:
        no_longer_needed(fault)


@pytest.mark.parametrize("correction", OF_ALL)
def test_all_versions_need_the_other_corrections(correction: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def correct(_modules: Modules) -> None:
        """Correct nothing."""

    monkeypatch.setattr(translation, "use_numbers", lambda _files: False)
    monkeypatch.setattr(translation, "correct", correct)
    designs = OF_ALL[correction]
    if right := {item.name for item in designs} - set(wrong_ones(designs)):
        no_longer_needed(", ".join(sorted(right)))
