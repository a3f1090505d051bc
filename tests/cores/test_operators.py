"""cores/acc/float/operators.yaml: ports as entities have them, figures as pages have them.

tests/cores/test_float.py compares the latencies with simulations.
"""

from __future__ import annotations

import re
from typing import Any

import pytest
import yaml

from tests.cores.operators import FORMS, OPERATORS, Form
from tests.hdl.ghdl import CORES, REPOSITORY

_PORT = re.compile(r"^ +(?P<name>(?:in|out)_\w+) +: (?:in |out) +(?P<type>\S.*?)(?: := '\d')?;?$", re.MULTILINE)
_HANDSHAKE = {"in_valid", "in_ready", "out_valid", "out_ready"}
_TYPES = {"std_logic": "bit", "std_logic_vector(WIDTH-1 downto 0)": "fixed"}
_FIGURES = (REPOSITORY / "docs" / "figures" / "timing.md").read_text(encoding="utf-8")
_OVERVIEW = (REPOSITORY / "docs" / "reference" / "arithmetic.md").read_text(encoding="utf-8")


def ports(entity: str) -> dict[str, str]:
    """The types of all ports but the handshake."""
    text = (CORES / "acc" / "float" / "rtl" / f"{entity}.vhd").read_text(encoding="utf-8")
    found = {port["name"]: _TYPES.get(port["type"], "number") for port in _PORT.finditer(text)}
    return {name: kind for name, kind in found.items() if name not in _HANDSHAKE}


def test_every_operation_has_an_entry() -> None:
    in_the_page = set(re.findall(r"^\| `(firm_(?:float|fixed_to)_\w+)` \|", _OVERVIEW, re.MULTILINE))
    assert {facts["entity"] for facts in OPERATORS.values()} == in_the_page


@pytest.mark.parametrize("operator", OPERATORS)
def test_ports_are_those_of_the_entity(operator: str) -> None:
    facts: dict[str, Any] = OPERATORS[operator]
    assert {**facts["inputs"], **facts["outputs"]} == ports(facts["entity"])


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_figures_are_the_measured_ones(form: Form) -> None:
    bits = {"float64": "64", "float32": "32"}
    design = form.entity if form.name == "default" else f"{form.entity}, {form.name}"
    if form.operator == "resize":
        design += f" to {bits['float32' if form.size == 'float64' else 'float64']} bits"
    (line,) = (cells for cells in map(_cells, _FIGURES.splitlines()) if cells[:2] == [design, bits[form.size]])
    megahertz, _, lut, ff = line[2:6]
    assert (megahertz, lut, ff) == tuple(str(form.facts[name]) for name in ("megahertz", "lut", "ff"))


@pytest.mark.parametrize("operation", ["multiply", "divide"])
def test_figures_of_fixed_point_operators_are_the_measured_ones(operation: str) -> None:
    file = CORES / "acc" / "fixed" / "operators.yaml"
    forms = yaml.safe_load(file.read_text(encoding="utf-8"))["operators"][f"fixed_{operation}"]["forms"]["default"]
    lines = [_cells(line) for line in _FIGURES.splitlines() if line.startswith(f"| firm_fixed_{operation} ")]
    figures = {size: [str(facts[name]) for name in ("megahertz", "lut", "ff")] for size, facts in forms.items()}
    assert figures == {f"fixed{cells[1]}": [cells[2], *cells[4:6]] for cells in lines}


@pytest.mark.parametrize("operator", [name for name in OPERATORS if name not in ("resize", "from_fixed", "to_fixed")])
def test_the_page_has_the_latencies(operator: str) -> None:
    entity, sizes = OPERATORS[operator]["entity"], OPERATORS[operator]["forms"]["default"]
    (row,) = re.findall(rf"^\| `{entity}` \|.*$", _OVERVIEW, re.MULTILINE)
    latencies = [sizes[size]["latency"] for size in ("float64", "float32")]
    assert " / ".join(map(str, latencies)) in row or set(latencies) == {int(_cells(row)[2])}


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]
