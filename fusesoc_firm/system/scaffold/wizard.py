"""`firm system new`: build a specification from the user's answers to questions that follow the grammar.

All keys, with their meanings and legal values, come from `specification`. An existing file is extended and keeps its
comments. In a new file, a comment explains each key at its first use.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

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
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import check_output, write
from fusesoc_firm.text.prompts import Asker, Question
from fusesoc_firm.text.yaml_edit import EditError, document, insert, put, value_at
from fusesoc_firm.text.yaml_edit import Path as Place
from fusesoc_firm.text.yaml_sections import Key, Section, keys_of
from fusesoc_firm.text.yaml_text import data_of, read_yaml

# All messages that the specification's `paths` provide.
MessageNames = Callable[[Sequence[str]], Sequence[str]]

Draft = dict[str, Any]
"""A section as plain data."""

# A key with its value on one line.
_KEY = re.compile(r" *(?:- )?(\w+): .")
_YES, _NO = "yes", "no"


def extend_specification(path: Path, asker: Asker, message_names: MessageNames) -> None:
    """Ask for a new specification, or for extensions of an existing one, and write the file."""
    check_output(path)
    before = ""
    content: dict[str, Any] = {}
    if not (is_new := not path.exists()):
        read = read_yaml(path)  # Report invalid YAML with its place.
        before, content = path.read_text(encoding="utf-8"), data_of(read.root)
        if not isinstance(content, dict):
            fail(f"{path} is not a specification")
    wizard = _Wizard(asker, message_names, content, is_new, path.parent, before)
    try:
        wizard.run()
    except EditError as error:
        fail(f"cannot extend {path}: {error}")
    write(path, _explained(document(content), wizard.explained) if is_new else wizard.text)


def _explained(text: str, meanings: dict[str, str]) -> str:
    """Return a text with a comment at the first use of each key."""
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if meaning := (found := _KEY.match(line)) and meanings.pop(found[1], None):
            lines[number] = f"{line} # {meaning}"
    return "\n".join([*lines, ""])


@dataclass
class _Wizard:
    """The state of one run: the specification so far, as data and, unless it is new, as text.

    `explained` contains the meaning of each key so far.
    """

    asker: Asker
    message_names: MessageNames
    content: dict[str, Any]
    is_new: bool
    folder: Path
    text: str
    explained: dict[str, str] = field(default_factory=dict)

    def run(self) -> None:
        """Ask all questions, in the order of the grammar."""
        if self.is_new:
            self.asker.tell("project")
            self.content["project"] = self._section(Project)
            self._ask_paths()
        for name in ("accelerators", "blocks"):
            if added := self._sections(name, _key(Specification, name)):
                self._add([name], added, keys_of(Specification))
        if not self.is_new:
            self._connect_blocks()

    def _ask_paths(self) -> None:
        """Ask for the folders and cores of a new specification's messages, which also become completions."""
        entry = _key(Specification, "paths")
        question = Question("paths", entry.meaning, check=self._fault_of_path)
        if found := self._texts(question):
            self.content["paths"] = found
            self._explain("paths", entry)

    def _fault_of_path(self, answer: str) -> str | None:
        is_there = is_core(answer) or (self.folder / answer).exists()
        return None if is_there else f"'{answer}' is not a folder, a bag or a core"

    def _connect_blocks(self) -> None:
        """Ask for further connections from existing blocks of the file."""
        names = self._names("blocks")
        question = Question("block", "the block to which connections are added", names, is_choice=True)
        while name := self.asker.ask(question):
            if added := self._sections("outgoing", _key(Block, "outgoing"), name):
                self._add(["blocks", names.index(name), "outgoing"], added, keys_of(Block))

    def _add(self, path: Place, added: Sequence[Draft], order: Iterable[str]) -> None:
        """Append sections to the list at a path."""
        above = value_at(self.content, path[:-1])
        before = above.get(path[-1]) or []
        above[path[-1]] = [*before, *added]
        if self.is_new:
            return
        if not before:
            self.text = put(self.text, path, added, [*order])
        for number, item in enumerate(added if before else (), len(before)):
            self.text = insert(self.text, path, number, item)

    # --- sections --------------------------------------------------------------------------------------------------

    def _sections(self, name: str, entry: Key, owner: str = "") -> list[Draft]:
        """Ask for as many sections as the user wants; a mandatory list gets at least one."""
        assert entry.section
        question = Question(f"add to '{name}'", entry.meaning, (_YES, _NO), is_choice=True, default=_NO)
        found: list[Draft] = []
        while (entry.is_required and self.is_new and not found) or self.asker.ask(question) == _YES:
            self.asker.tell(f"{name} {len(found) + 1}{f' of {owner}' if owner else ''}")
            found.append(self._section(entry.section, found))
        return found

    def _section(self, section: type[Section], siblings: Sequence[Draft] = ()) -> Draft:
        """Ask for one section, key by key."""
        draft = _Draft(section, siblings)
        for name, (field_name, entry) in keys_of(section).items():
            if draft.has(name, entry) and (value := self._value(draft, name, field_name, entry)):
                draft.made[name] = value
                self._explain(name, entry)
        return draft.made

    def _explain(self, name: str, entry: Key) -> None:
        """Note the meaning of a key at its first use; a section's name needs no explanation."""
        if entry.section is None:
            self.explained.setdefault(name, entry.meaning)

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
        return "" if answer == question.default else answer

    def _texts(self, question: Question) -> Any:
        """Ask for answers until an answer is empty."""
        found: list[str] = []
        further = Question(f"another item of {question.name}", question.meaning, question.words, check=question.check)
        while answer := self.asker.ask(further if found else question):
            found.append(answer)
        return found[0] if len(found) == 1 else found

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
    siblings: Sequence[Draft]
    made: Draft = field(default_factory=dict)

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
