"""Every key of every shipped specification: omitted, misspelt, indented differently, and as the end of the file.

`firm check` must report the fault at its place, with the key's name, and a valid text must give a system.
"""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.system.written.specification import Specification
from fusesoc_firm.text.diagnostics import nearest
from fusesoc_firm.text.yaml_sections import Section, keys_of
from tests.errors.key_sites import KeySite, key_sites, misspellings, spellings_of
from tests.seeds import seeded

SPECS = Path(__file__).resolve().parents[2] / "specs"
SEED = seeded(20241103)
_PLACE = re.compile(r"(?P<file>.*):(?P<line>\d+):(?P<column>\d+): (?P<kind>error|warning): (?P<message>.*)")
_EXCERPT = re.compile(r" *(?P<line>\d+) \| (?P<text>.*)")


def specifications() -> list[Path]:
    """The specifications: files with the keys that the grammar requires, none of which stimuli have."""
    required = {name for name, (_, entry) in keys_of(Specification).items() if entry.is_required}
    found = []
    for path in sorted(SPECS.glob("*/*.yaml")):
        content = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.CSafeLoader)
        if isinstance(content, dict) and required <= content.keys():
            found.append(path)
    return found


@dataclass(frozen=True)
class Fault:
    """A fault as printed: `words` are its message and hint, `excerpt` is the displayed line, if any."""

    file: str
    line: int
    column: int
    words: str
    excerpt: str | None


@dataclass(frozen=True)
class Answer:
    """The result of `firm check` for a text."""

    text: str
    code: int
    output: str
    faults: tuple[Fault, ...]


@dataclass(frozen=True)
class Checker:
    """Runs `firm check` on variants of a specification, next to its sources."""

    path: Path
    message_paths: Sequence[Path]
    capture: pytest.CaptureFixture[str]

    def check(self, text: str) -> Answer:
        self.path.write_text(text, encoding="utf-8")
        paths = [word for path in self.message_paths for word in ("--path", str(path))]
        code = main(["system", "check", str(self.path), *paths])
        printed = self.capture.readouterr()
        return Answer(text, code, printed.out, tuple(_faults(printed.err)))


def _faults(printed: str) -> list[Fault]:
    """The printed faults without warnings; a line that does not belong to one is an error in the output."""
    found: list[Fault] = []
    kinds: list[str] = []
    for line in printed.splitlines():
        if place := _PLACE.fullmatch(line):
            found.append(Fault(place["file"], int(place["line"]), int(place["column"]), place["message"], None))
            kinds.append(place["kind"])
            continue
        fault = found.pop()
        if excerpt := _EXCERPT.fullmatch(line):
            assert int(excerpt["line"]) == fault.line
            fault = Fault(fault.file, fault.line, fault.column, fault.words, excerpt["text"])
        elif line.startswith("      = "):
            fault = Fault(fault.file, fault.line, fault.column, f"{fault.words}\n{line[8:]}", fault.excerpt)
        else:
            assert re.fullmatch(r" *\| *\^~*", line), f"neither fault nor excerpt: {line}"
        found.append(fault)
    return [fault for fault, kind in zip(found, kinds, strict=True) if kind == "error"]


@pytest.fixture
def checker(
    request: pytest.FixtureRequest,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Checker:
    spec: Path = request.param
    folder = tmp_path / spec.parent.name
    shutil.copytree(spec.parent, folder)
    make = libraries
    known: dict[Middleware, MessageLibrary] = {}

    def shared(paths: Sequence[Path], _: Mapping[str, str] | None, store: str | None) -> object:
        """Create the libraries once, without an installed ROS."""
        if not known:
            known.update(make(paths, None, store))
        return known

    monkeypatch.setattr("fusesoc_firm.system.message_sources.libraries", shared)
    # A specification may be right and no longer fit its accelerators; tests/accelerator compares these.
    monkeypatch.setattr("fusesoc_firm.cli.check.check_all", lambda *_, **__: ())
    own = [path for path in (folder / "msg", folder / "franka_msgs") if path.is_dir()]
    return Checker(folder / spec.name, own, capsys)


every_specification = pytest.mark.parametrize("checker", specifications(), ids=lambda path: path.stem, indirect=True)


def sites(checker: Checker) -> list[KeySite]:
    text = checker.path.read_text(encoding="utf-8")
    assert checker.check(text).code == 0
    return key_sites(text, Specification)


def problem(checker: Checker, answer: Answer) -> str:
    """An error in a result, whatever the text: an impossible place, or a status that does not fit."""
    if (answer.code == 0) != (not answer.faults) or (answer.code == 0) != (" is valid: " in answer.output):
        return f"exit status {answer.code} with {len(answer.faults)} faults"
    lines = answer.text.splitlines()
    for fault in answer.faults:
        if fault.file != str(checker.path) or not 1 <= fault.line <= len(lines):
            return f"{fault.file}:{fault.line} is not a place in the file"
        line = lines[fault.line - 1]
        if fault.excerpt != line or not 1 <= fault.column <= len(line) + 1:
            return f"line {fault.line}, column {fault.column} is shown as '{fault.excerpt}', but it is '{line}'"
    return ""


@pytest.mark.one_in(5, 3)
@every_specification
def test_a_key_that_is_left_out(checker: Checker) -> None:
    problems = []
    for site in sites(checker):
        answer = checker.check(site.without())
        found = problem(checker, answer)
        if not found and answer.code == 0 and site.is_needed:
            found = "it is required, and nobody misses it"
        if not found and answer.code and not any(_names_what_lacks(fault, site) for fault in answer.faults):
            found = f"no fault names key and section: {answer.faults}"
        if found:
            problems.append(f"without {site}: {found}")
    assert not problems, "\n".join(problems)


def _names_what_lacks(fault: Fault, site: KeySite) -> bool:
    """Whether a fault names the key, and is in its section or names it."""
    is_near = fault.line in site.lines or fault.line in site.parents.values()
    is_meant = any(f"'{word}'" in fault.words for word in site.parents)
    if site.is_needed:
        first = fault.line in (site.lines[0], *site.parents.values())
        return first and bool(re.search(rf"(needs?\b|required keys:).*\b{site.name}\b", fault.words))
    return (is_near or is_meant) and f"'{site.name}'" in fault.words


@pytest.mark.one_in(5, 3)
@every_specification
def test_a_key_that_is_misspelt(checker: Checker) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    problems = []
    for site in sites(checker):
        word = chance.choice([word for word in misspellings(site.name) if word not in spellings_of(site.section)])
        answer = checker.check(site.spelt(word))
        found = problem(checker, answer)
        start = site.key_node.start_mark
        told = [fault for fault in answer.faults if (fault.line, fault.column) == (site.line, start.column + 1)]
        expected = rf".* has no key '{word}'\ndid you mean '{site.name}'\?"
        if not found and not any(re.fullmatch(expected, fault.words) for fault in told):
            found = f"at its place stands {told}"
        if not found and any("needs the key" in fault.words for fault in answer.faults):
            found = f"the key is misspelt, but said to be missing as well: {answer.faults}"
        if found:
            problems.append(f"'{word}' for {site}: {found}")
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize("section", [Specification], ids=lambda section: section.__name__)
def test_every_misspelling_of_every_key_leads_to_it(section: type[Section]) -> None:
    lost = [
        (each.__name__, word, hint)
        for each in _sections(section)
        for spelling, name in spellings_of(each).items()
        for word in misspellings(spelling)
        if word not in spellings_of(each)
        and (hint := nearest(word, spellings_of(each)))
        and spellings_of(each).get(hint.removeprefix("did you mean '").removesuffix("'?")) != name
    ]
    assert not lost


def _sections(section: type[Section]) -> set[type[Section]]:
    inner = [entry.section for _, entry in keys_of(section).values() if entry.section]
    return {section}.union(*(_sections(each) for each in inner))


@pytest.mark.one_in(5, 3)
@every_specification
@pytest.mark.parametrize("shift", [1, -1])
def test_a_key_that_is_indented_otherwise(checker: Checker, shift: int) -> None:
    problems = []
    for site in sites(checker):
        text = site.shifted(shift)
        answer = checker.check(text) if text else None
        found = answer and (problem(checker, answer) or _what_no_fault_tells(answer, site))
        if found:
            problems.append(f"{site} indented by {shift:+d}: {found}")
    assert not problems, "\n".join(problems)


@pytest.mark.one_in(7, 3)
@every_specification
@pytest.mark.parametrize("shift", [0, 1, -1])
def test_a_file_that_ends_behind_a_key(checker: Checker, shift: int) -> None:
    problems = []
    for site in sites(checker):
        text = site.cut(shift)
        answer = checker.check(text) if text else None
        found = answer and problem(checker, answer)
        if answer and not found and any("not YAML" in fault.words for fault in answer.faults):
            found = _what_no_fault_tells(answer, site)
        if found:
            problems.append(f"behind {site} indented by {shift:+d}: {found}")
    assert not problems, "\n".join(problems)


def _what_no_fault_tells(answer: Answer, site: KeySite) -> str:
    """The fault of an unreported line: one that fits nowhere must be shown, or named by another line's fault."""
    told = [
        fault
        for fault in answer.faults
        if (fault.line == site.line and site.name in (fault.excerpt or ""))
        or f"{site.name}, line {site.line}" in fault.words
    ]
    return "" if told or answer.code == 0 else f"no fault shows it: {answer.faults}"
