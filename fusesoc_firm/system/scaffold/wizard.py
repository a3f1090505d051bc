"""`firm system new`: a specification by questions, along the grammar.

Which keys there are, what they mean and which answers are legal all comes from `specification`. An existing file is
extended and keeps its comments; in a new one each key is explained where it stands for the first time.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml as pyyaml
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.scalarstring import DoubleQuotedScalarString
from ruamel.yaml.util import load_yaml_guess_indent

from fusesoc_firm.system.written.specification import (
    ACCELERATOR,
    CONVERTER_KEYS,
    PUBLISHER,
    Accelerator,
    Block,
    Outgoing,
    Project,
    Specification,
    is_core,
)
from fusesoc_firm.text.outputs import check_output, write
from fusesoc_firm.text.prompts import Asker, Question
from fusesoc_firm.text.yaml_sections import Key, Section, keys_of
from fusesoc_firm.text.yaml_text import LONGEST_NUMBER, read_yaml

# All messages that can be named, by the specification's `paths`.
MessageNames = Callable[[Sequence[str]], Sequence[str]]

_YES, _NO = "yes", "no"


def extend_specification(path: Path, asker: Asker, message_names: MessageNames) -> None:
    """Ask for a specification and write it, or for more of one that is there."""
    check_output(path)
    is_new = not path.exists()
    if not is_new:
        read_yaml(path)  # reports what is no YAML, at its place
    before = "" if is_new else path.read_text(encoding="utf-8")
    content = CommentedMap() if is_new else _style(before).load(before)
    _Wizard(asker, message_names, content, is_new, path.parent).run()
    text = io.StringIO()
    _style(before).dump(content, text)
    write(path, text.getvalue())


def _style(text: str) -> YAML:
    """YAML that is written as `text` is: with its quotes, and lists that stand as far in; as ours without any."""
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.brace_single_entry_mapping_in_flow_sequence = True
    yaml.width = 10**6
    # The dash of a list's item, and what comes after it, from where its key begins.
    _, item, dash = load_yaml_guess_indent(text) if text else (None, None, None)
    yaml.indent(sequence=item or 4, offset=2 if dash is None else dash)
    return yaml


def _word(answer: str) -> Any:
    """An answer as a scalar; in quotes where YAML, or a list around it, would take it for another value."""
    if answer.isdecimal() and len(answer) <= LONGEST_NUMBER and str(int(answer)) == answer:
        # A number is as good a word, and reads better without quotes.
        return int(answer)
    try:
        is_plain = pyyaml.safe_load(f"[{answer}]") == [answer]
    except (pyyaml.YAMLError, ValueError):
        is_plain = False
    return answer if is_plain else DoubleQuotedScalarString(answer)


def _words(answers: Sequence[str]) -> Any:
    """Answers on one line: a word, or a list in brackets."""
    if len(answers) < 2:
        return _word(answers[0]) if answers else []
    words = CommentedSeq(map(_word, answers))
    words.fa.set_flow_style()
    return words


@dataclass
class _Wizard:
    """The state of one run: the specification as far as it is known; in a new one, which keys have been explained."""

    asker: Asker
    message_names: MessageNames
    content: Any
    is_new: bool
    folder: Path
    explained: set[str] = field(default_factory=set)

    def run(self) -> None:
        """All questions, in the order of the grammar."""
        if self.is_new:
            self.asker.tell("project")
            self.content["project"] = self._section(Project)
            self._ask_paths()
        for name in ("accelerators", "blocks"):
            if added := self._sections(name, _key(Specification, name)):
                self.content.setdefault(name, []).extend(added)
        if not self.is_new:
            self._connect_blocks()

    def _ask_paths(self) -> None:
        """Where the messages of a new specification are defined, which decides how messages are completed."""
        entry = _key(Specification, "paths")
        question = Question("paths", entry.meaning, check=self._fault_of_path)
        if found := self._texts(question):
            self.content["paths"] = found
            self._explain(self.content, "paths", entry)

    def _fault_of_path(self, answer: str) -> str | None:
        is_there = is_core(answer) or (self.folder / answer).exists()
        return None if is_there else f"'{answer}' is neither a folder, a bag nor a core"

    def _connect_blocks(self) -> None:
        """Further connections from blocks that the file has."""
        blocks = {str(block["name"]): block for block in self.content.get("blocks", [])}
        question = Question("block", "a block to which further connections are added", [*blocks], is_choice=True)
        while name := self.asker.ask(question):
            if added := self._sections("outgoing", _key(Block, "outgoing"), name):
                blocks[name].setdefault("outgoing", []).extend(added)

    # --- sections --------------------------------------------------------------------------------------------------

    def _sections(self, name: str, entry: Key, owner: str = "") -> list[CommentedMap]:
        """As many sections as are wanted, at least one where there must be one."""
        assert entry.section
        question = Question(f"add to '{name}'", entry.meaning, (_YES, _NO), is_choice=True, default=_NO)
        found: list[CommentedMap] = []
        while (entry.is_required and self.is_new and not found) or self.asker.ask(question) == _YES:
            self.asker.tell(f"{name} {len(found) + 1}{f' of {owner}' if owner else ''}")
            found.append(self._section(entry.section, found))
        return found

    def _section(self, section: type[Section], siblings: Sequence[CommentedMap] = ()) -> CommentedMap:
        """One section, key by key."""
        draft = _Draft(section, siblings)
        for name, (field_name, entry) in keys_of(section).items():
            if draft.has(entry) and (value := self._value(draft, name, field_name, entry)):
                draft.made[name] = value
                self._explain(draft.made, name, entry)
        return draft.made

    def _explain(self, made: CommentedMap, name: str, entry: Key) -> None:
        """Say what a key means where it stands for the first time; a section's name says enough."""
        if self.is_new and entry.section is None and name not in self.explained:
            self.explained.add(name)
            made.yaml_add_eol_comment(entry.meaning, name, column=0)

    def _value(self, draft: _Draft, name: str, field_name: str, entry: Key) -> Any:
        """A key's value; empty if it is left out."""
        if entry.form == "sections":
            return self._sections(name, entry, str(draft.made.get("name", "")))
        if entry.form == "section":
            assert entry.section
            return self._section(entry.section)
        is_type = draft.section is Block and name == "type"
        question = Question(
            name,
            entry.meaning,
            self._words(draft.section, name, entry),
            is_choice=bool(entry.choices) or is_type,
            is_required=draft.needs(name, entry),
            default=_default(draft.section, field_name),
            check=lambda answer: self._fault(draft, name, entry, answer),
        )
        if entry.form == "texts":
            return self._texts(question)
        answer = self.asker.ask(question)
        if answer == question.default:
            return None
        return _word(answer) if answer else None

    def _texts(self, question: Question) -> Any:
        """One answer after the other, until an empty one."""
        found: list[str] = []
        further = Question(f"another item of {question.name}", question.meaning, question.words, check=question.check)
        while answer := self.asker.ask(further if found else question):
            found.append(answer)
        return _words(found)

    # --- answers ---------------------------------------------------------------------------------------------------

    def _words(self, section: type[Section], name: str, entry: Key) -> Sequence[str]:
        """What an answer can be completed to."""
        if entry.choices:
            return [str(choice) for choice in entry.choices]
        if name == "message":
            paths = self.content.get("paths") or []
            return self.message_names([paths] if isinstance(paths, str) else [str(item) for item in paths])
        if section is Block and name == "type":
            return self._names("accelerators")
        if section is Block and name == "clock":
            project = self.content.get("project") or {}
            return [str(clock["name"]) for clock in project.get("clocks") or []]
        if section is Outgoing and name == "name":
            return self._names("blocks")
        return ()

    def _names(self, name: str) -> list[str]:
        return [str(item["name"]) for item in self.content.get(name, [])]

    def _fault(self, draft: _Draft, name: str, entry: Key, answer: str) -> str | None:
        """What makes an answer wrong, beyond the grammar's choices."""
        if answer and (fault := entry.rule(answer)):
            return f"'{name}' {fault[0]}; {fault[1]}"
        if entry.form == "integer" and not answer.isdecimal():
            return f"'{name}' must be an integer, not '{answer}'"
        if name == "name" and draft.section in (Accelerator, Block):
            taken = self._names("blocks" if draft.section is Block else "accelerators")
            if answer in (*taken, *(str(item["name"]) for item in draft.siblings)):
                return f"'{answer}' already exists"
        return None


@dataclass
class _Draft:
    """A section on its way, beside those of its list that are made."""

    section: type[Section]
    siblings: Sequence[CommentedMap]
    made: CommentedMap = field(default_factory=CommentedMap)

    def has(self, entry: Key) -> bool:
        """Whether a key is asked for, after the answers so far: what a block is decides which ones it has."""
        if self.section is not Block or not entry.only_of:
            return True
        if entry.only_of == PUBLISHER:
            return bool(self.made.get("mode") == PUBLISHER)
        return ("type" in self.made) is (entry.only_of == ACCELERATOR)

    def needs(self, name: str, entry: Key) -> bool:
        """Whether a key must be there: what makes a converter, the grammar leaves open to a block."""
        return entry.is_needed(self.made) or (self.section is Block and name in CONVERTER_KEYS)


def _default(section: type[Section], field_name: str) -> str:
    (default,) = (item.default for item in fields(section) if item.name == field_name)
    return str(default) if isinstance(default, str | int) else ""


def _key(section: type[Section], name: str) -> Key:
    return keys_of(section)[name][1]
