"""Lines of generated files, and the lines of the specification to which they belong."""

from __future__ import annotations

import pytest

from fusesoc_firm.accelerator.origin import origin
from fusesoc_firm.converter.configuration import subscriber_entity
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import LoadedSystem, artifacts
from fusesoc_firm.tools.library_path import demos_root


@pytest.fixture(scope="module")
def loaded() -> LoadedSystem:
    return load_beside(demos_root() / "multi_type" / "multi_type.yaml")


def test_each_instance_belongs_to_its_block(loaded: LoadedSystem) -> None:
    lines = artifacts(loaded)[-1].text.splitlines()
    found = set()
    for number, line in enumerate(lines, 1):
        is_first = line.startswith("  u_")
        if is_first or number % 20 == 0:
            source = origin(loaded, "multi_type_system", lines, number)
            assert source
            if is_first:
                found.add(source)
    assert {block.name.source for block in loaded.specification.blocks} <= found


def test_lines_before_instances_belong_to_the_project(loaded: LoadedSystem) -> None:
    source = origin(loaded, "multi_type_system", ["entity multi_type_system is"], 1)
    assert source == loaded.specification.project.name.source


def test_a_converter_belongs_to_its_block(loaded: LoadedSystem) -> None:
    converter = loaded.system.subscribers[-1]
    source = origin(loaded, subscriber_entity(converter.frame, converter.suffix), [], 1)
    assert source == next(block.name.source for block in loaded.specification.blocks if block.name == converter.block)
    assert origin(loaded, "another", [], 1) is None
