"""The grammar: what each key takes, what is read behind a fault, and that its page says the same."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from fusesoc_firm.converter.config_file import ConfigFile
from fusesoc_firm.system.written.specification import Specification
from fusesoc_firm.text.yaml_sections import Key, Section, keys_of
from tests.system.systems import read

DOCS = Path(__file__).resolve().parents[2] / "docs" / "reference"
_FORMS = {"text": "word", "texts": "words"}


def first(folder: Path, text: str) -> str:
    _, faults = read(folder, text)
    return faults.found[0].message if faults.found else ""


@pytest.mark.parametrize("spelling", ["fpgaPart", "fpgaPartpart", "FPGA"])
def test_spellings_of_a_key(tmp_path: Path, spelling: str) -> None:
    specification, faults = read(tmp_path, f"project: {{name: a, {spelling}: xc7}}\nblocks: [{{name: b}}]\n")
    assert not faults.found
    assert specification.project.fpga_part == "xc7"
    assert specification.is_sound


def test_one_key_in_two_spellings_is_given_twice(tmp_path: Path) -> None:
    text = "project: {name: a, fpgaPart: b, FPGA: c}\nblocks: [{name: b}]\n"
    assert first(tmp_path, text) == "key 'fpgaPart' is given twice, here as 'FPGA'"


def test_a_key_without_a_value_is_as_good_as_none(tmp_path: Path) -> None:
    text = "project: {name: a, width: , scheduler: ~}\naccelerators:\nblocks: [{name: b, type: , outgoing: }]\n"
    specification, faults = read(tmp_path, text)
    assert not faults.found
    assert (specification.project.width, specification.project.scheduler) == (8, "fixed_priority")
    assert specification.accelerators == ()
    assert (specification.blocks[0].type, specification.blocks[0].outgoing) == (None, ())


@pytest.mark.parametrize("sources", ["a.vhd", "[a.vhd]", "\n      - a.vhd"])
def test_one_word_is_a_list_of_one(tmp_path: Path, sources: str) -> None:
    text = f"project: {{name: a}}\naccelerators:\n  - name: b\n    type: VHDL\n    sources: {sources}\n"
    specification, _ = read(tmp_path, text + "    interface: {}\nblocks: [{name: b}]\n")
    assert specification.accelerators[0].sources == ("a.vhd",)


@pytest.mark.parametrize("word", ["123", "yes", "1e-3", "2024-01-01"])
def test_a_word_is_text_whatever_yaml_takes_it_for(tmp_path: Path, word: str) -> None:
    specification, _ = read(tmp_path, f"project: {{name: {word}}}\nblocks: [{{name: b}}]\n")
    assert specification.project.name == word


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("project: {name: a, width: '8'}", "'width' must be an integer, not '8'"),
        ("project: {name: a, width: [8]}", "'width' must be an integer, not a list"),
        ("project: {name: a, width: 24}", "'width' cannot be '24'"),
        ("project: {name: {}}", "'name' must be a word, not a mapping"),
        ("project: {name: ''}", "'name' must be a word, not ''"),
        ("project:", "'project' must be a mapping of keys to values, not nothing"),
        ("blocks: []", "'blocks' is an empty list"),
        ("blocks: {name: a}", "'blocks' must be a list with one '- ' per item, not a mapping"),
        ("blocks: [a]", "an item of 'blocks' must be a mapping of keys to values, not 'a'"),
        ("- project", "a specification must be a mapping of keys to values, not a list"),
        ("word", "a specification must be a mapping of keys to values, not 'word'"),
    ],
)
def test_a_form_that_does_not_fit(tmp_path: Path, text: str, message: str) -> None:
    _, faults = read(tmp_path, text)
    assert message in [fault.message for fault in faults.found]


def test_what_is_right_is_read_beside_what_is_wrong(tmp_path: Path) -> None:
    text = """\
project: {nam: a, fpgaPart: part}
blocks:
  - {name: good, mode: subscriber}
  - {name: bad, mode: sub, message: a/B}
  - {message: c/D}
"""
    specification, faults = read(tmp_path, text)
    assert len(faults.found) == 3
    assert (specification.project.name, specification.project.fpga_part) == ("", "part")
    assert [block.is_sound for block in specification.blocks] == [True, False, False]
    assert [block.name for block in specification.blocks] == ["good", "bad", ""]
    assert [block.message for block in specification.blocks] == [None, "a/B", "c/D"]
    assert specification.blocks[1].mode is None


def test_a_file_that_is_cut_lacks_nothing_and_is_not_sound(tmp_path: Path) -> None:
    specification, faults = read(tmp_path, "project:\n  fpgaPart: part\nblocks:\n  - {name: a\n")
    (fault,) = faults.found
    assert fault.message.startswith("invalid YAML")
    assert specification.is_cut
    assert not specification.project.is_sound


def _rows(section: type[Section], names: str) -> list[list[str]]:
    """The page's rows for a section, and those within."""
    rows = []
    inner: dict[type[Section], list[str]] = {}
    for name, (field, entry) in keys_of(section).items():
        spellings = ", ".join(f"`{spelling}`" for spelling in (name, *entry.aliases))
        form = _FORMS.get(entry.form, entry.form)
        legal = ", ".join(str(choice) for choice in entry.choices)
        rows.append([names, spellings, form, _default(section, field, entry), legal, entry.meaning])
        if entry.section:
            inner.setdefault(entry.section, []).append(f"`{name}`")
    for found, keys in inner.items():
        rows += _rows(found, ", ".join(keys))
    return rows


def _default(section: type[Section], field: str, entry: Key) -> str:
    if entry.is_required:
        return "required" + (f" unless `{entry.unless[0]}` is {entry.unless[1]}" if entry.unless else "")
    (default,) = (item.default for item in dataclasses.fields(section) if item.name == field)
    return "none" if default in (None, ()) else str(default)


@pytest.mark.parametrize(
    ("page", "grammar"), [("specification.md", Specification), ("converter-configuration.md", ConfigFile)]
)
def test_the_page_has_every_key_as_it_is(page: str, grammar: type[Section]) -> None:
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    start = lines.index("| section | key | form | default | legal | meaning |") + 2
    table = lines[start : lines.index("", start)]
    written = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    assert sorted(written) == sorted(_rows(grammar, "(the file)"))


ACCELERATORS = "project: {name: a}\naccelerators: [{name: b, type: TYPE, interface: {}SOURCES}]\nblocks: [{name: c}]\n"


@pytest.mark.parametrize(
    ("kind", "sources", "message"),
    [
        (
            "VHDL",
            "",
            (
                "an item of 'accelerators' needs the key 'sources': the accelerator's source files, relative to the"
                " specification"
            ),
        ),
        ("VHDL", ", sources: ", "'sources' must be a word, not nothing"),
        ("ROS-SW", "", ""),
        ("ROS-SW", ", sources: ", ""),
        ("ROS-SW", ", sources: []", "'sources' is an empty list"),
        ("ROS-SW", ", sources: a.py", ""),
    ],
)
def test_a_key_that_depends_on_another(tmp_path: Path, kind: str, sources: str, message: str) -> None:
    text = ACCELERATORS.replace("TYPE", kind).replace("SOURCES", sources)
    specification, faults = read(tmp_path, text)
    assert [fault.message for fault in faults.found] == ([message] if message else [])
    assert specification.accelerators[0].is_sound is not bool(message)
