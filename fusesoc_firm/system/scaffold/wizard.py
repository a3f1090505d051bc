"""`firm system new`: build a specification from the user's answers to questions that follow the grammar.

All keys, with their meanings and legal values, come from `specification`. An existing file is extended and keeps its
comments. In a new file, a comment explains each key at its first use.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.scalarstring import DoubleQuotedScalarString
from ruamel.yaml.util import load_yaml_guess_indent

from fusesoc_firm.system.written.specification import (
    ACCELERATOR,
    CONVERTER_KEYS,
    MESSAGE_KEYS,
    SERVICE_KEYS,
    SERVICE_MODES,
    TOPIC_MODES,
    Accelerator,
    Block,
    Outgoing,
    Project,
    Specification,
    is_core,
)
from fusesoc_firm.text.outputs import check_output, write
from fusesoc_firm.text.prompts import Asker, Question
from fusesoc_firm.text.yaml_edit import is_number, word
from fusesoc_firm.text.yaml_sections import Key, Section, keys_of
from fusesoc_firm.text.yaml_text import read_yaml

# All messages that the specification's `paths` provide.
MessageNames = Callable[[Sequence[str]], Sequence[str]]

_YES, _NO = "yes", "no"


def extend_specification(path: Path, asker: Asker, message_names: MessageNames) -> None:
    """Ask for a new specification, or for extensions of an existing one, and write the file."""
    check_output(path)
    is_new = not path.exists()
    if not is_new:
        read_yaml(path)  # Report invalid YAML with its place.
    before = "" if is_new else path.read_text(encoding="utf-8")
    content = CommentedMap() if is_new else _style(before).load(before)
    _Wizard(asker, message_names, content, is_new, path.parent).run()
    text = io.StringIO()
    _style(before).dump(content, text)
    write(path, text.getvalue())


def _style(text: str) -> YAML:
    """Return a YAML writer with the quotes and the list indentation of `text`.

    In new files, plain words have no quotes.
    """
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.brace_single_entry_mapping_in_flow_sequence = True
    yaml.width = 10**6
    # The dash of a list item and the text after the dash; the dash is in the column of the list's key.
    _, item, dash = load_yaml_guess_indent(text) if text else (None, None, None)
    yaml.indent(sequence=item or 4, offset=2 if dash is None else dash)
    return yaml


def _word(answer: str) -> Any:
    """Return an answer as a scalar, in quotes if YAML would otherwise misread it, alone or in a list."""
    written = word(answer)
    if written != answer:
        return DoubleQuotedScalarString(answer)
    return int(answer) if is_number(answer) else answer


def _words(answers: Sequence[str]) -> Any:
    """Return one line of answers as a scalar or as a list in brackets."""
    if len(answers) < 2:
        return _word(answers[0]) if answers else []
    words = CommentedSeq(map(_word, answers))
    words.fa.set_flow_style()
    return words


@dataclass
class _Wizard:
    """The state of one run: the specification so far and, for a new specification, the keys explained so far."""

    asker: Asker
    message_names: MessageNames
    content: Any
    is_new: bool
    folder: Path
    explained: set[str] = field(default_factory=set)

    def run(self) -> None:
        """Ask all questions, in the order of the grammar."""
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
        """Ask for the folders and cores of a new specification's messages, which also become completions."""
        entry = _key(Specification, "paths")
        question = Question("paths", entry.meaning, check=self._fault_of_path)
        if found := self._texts(question):
            self.content["paths"] = found
            self._explain(self.content, "paths", entry)

    def _fault_of_path(self, answer: str) -> str | None:
        is_there = is_core(answer) or (self.folder / answer).exists()
        return None if is_there else f"'{answer}' is not a folder, a bag or a core"

    def _connect_blocks(self) -> None:
        """Ask for further connections from existing blocks of the file."""
        blocks = {str(block["name"]): block for block in self.content.get("blocks", [])}
        question = Question("block", "the block to which connections are added", [*blocks], is_choice=True)
        while name := self.asker.ask(question):
            if added := self._sections("outgoing", _key(Block, "outgoing"), name):
                blocks[name].setdefault("outgoing", []).extend(added)

    # --- sections --------------------------------------------------------------------------------------------------

    def _sections(self, name: str, entry: Key, owner: str = "") -> list[CommentedMap]:
        """Ask for as many sections as the user wants; a mandatory list gets at least one."""
        assert entry.section
        question = Question(f"add to '{name}'", entry.meaning, (_YES, _NO), is_choice=True, default=_NO)
        found: list[CommentedMap] = []
        while (entry.is_required and self.is_new and not found) or self.asker.ask(question) == _YES:
            self.asker.tell(f"{name} {len(found) + 1}{f' of {owner}' if owner else ''}")
            found.append(self._section(entry.section, found))
        return found

    def _section(self, section: type[Section], siblings: Sequence[CommentedMap] = ()) -> CommentedMap:
        """Ask for one section, key by key."""
        draft = _Draft(section, siblings)
        for name, (field_name, entry) in keys_of(section).items():
            if draft.has(name, entry) and (value := self._value(draft, name, field_name, entry)):
                draft.made[name] = value
                self._explain(draft.made, name, entry)
        return draft.made

    def _explain(self, made: CommentedMap, name: str, entry: Key) -> None:
        """Add a comment that explains a key at its first use; a section's name needs no explanation."""
        if self.is_new and entry.section is None and name not in self.explained:
            self.explained.add(name)
            made.yaml_add_eol_comment(entry.meaning, name, column=0)

    def _value(self, draft: _Draft, name: str, field_name: str, entry: Key) -> Any:
        """Ask for a key's value; return an empty value if the user omits the key."""
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
        """Ask for answers until an answer is empty."""
        found: list[str] = []
        further = Question(f"another item of {question.name}", question.meaning, question.words, check=question.check)
        while answer := self.asker.ask(further if found else question):
            found.append(answer)
        return _words(found)

    # --- answers ---------------------------------------------------------------------------------------------------

    def _words(self, section: type[Section], name: str, entry: Key) -> Sequence[str]:
        """Return the completions for an answer."""
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
        """Return the fault in an answer that the grammar's choices do not exclude."""
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
    """An unfinished section, with the finished sections of the same list."""

    section: type[Section]
    siblings: Sequence[CommentedMap]
    made: CommentedMap = field(default_factory=CommentedMap)

    def has(self, name: str, entry: Key) -> bool:
        """Return whether to ask for a key, given the answers so far: the kind of a block determines its keys."""
        if self.section is Block and name in SERVICE_KEYS | MESSAGE_KEYS:
            is_service = self.made.get("mode") in SERVICE_MODES
            if is_service is not (name in SERVICE_KEYS):
                return False
        if self.section is not Block or not entry.only_of:
            return entry.is_asked
        if entry.only_of in TOPIC_MODES:
            return entry.is_asked and self.made.get("mode") == entry.only_of
        return entry.is_asked and ("type" in self.made) is (entry.only_of == ACCELERATOR)

    def needs(self, name: str, entry: Key) -> bool:
        """Return whether a key is mandatory; the keys of a converter are optional in a block's grammar."""
        return entry.is_needed(self.made) or (self.section is Block and name in (*CONVERTER_KEYS, "service"))


def _default(section: type[Section], field_name: str) -> str:
    (default,) = (item.default for item in fields(section) if item.name == field_name)
    return str(default) if isinstance(default, str | int) else ""


def _key(section: type[Section], name: str) -> Key:
    return keys_of(section)[name][1]
