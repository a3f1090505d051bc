"""Explain generated lines by the lines of the template, the specification and the messages that they originate from.

The file is rendered again to find the template's line and the scope in the context. The lines in the specification and
in messages are found by names. The relevant blocks are those named on the line or, if the line names no block, in the
innermost scope that names blocks. The relevant fields belong to these blocks' messages or, in a file about a message,
to that message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.builds.call.answer import read_request
from fusesoc_firm.builds.call.calls import read_call
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.builds.call.requesting_core import find_requesting_core
from fusesoc_firm.converter.converter_core import order_of_request
from fusesoc_firm.core.request import GeneratedCore, Request
from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import MessageName, nested_message
from fusesoc_firm.system.system_core import load_requested
from fusesoc_firm.system.written.specification import Specification
from fusesoc_firm.text.diagnostics import SourceRef, fail
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.render import Rendering, TracedLine, recorded, traced_lines
from fusesoc_firm.tools.reads import Input

Message = tuple[MessageName, Definitions]

_WORD = re.compile(r"[A-Za-z]\w*")
_STEP = re.compile(r"([^.\[\]]+)(?:\[(\d+)\])?")
# The text between a block's name and a field's name in a signal's name.
_SIDE = re.compile(r"(?:in|out)\d*_")


@dataclass(frozen=True)
class Reason:
    """A line of a generated file, with the places from which it originates."""

    line: TracedLine
    specification: tuple[SourceRef, ...]
    messages: tuple[SourceRef, ...]


@dataclass(frozen=True)
class Names:
    """The places of the names of blocks, and of fields and constants, by block and for all messages together."""

    blocks: Mapping[str, SourceRef]
    fields: Mapping[str, Mapping[str, SourceRef]]
    messages: Mapping[str, Mapping[str, SourceRef]]


def why(path: Path) -> list[Reason]:
    """Return the origin of each line of a generated file in a build. May raise `InputError`."""
    call, name = call_file(path)
    command = _generator(call)
    request = read_request(command, call, GENERATORS[command])
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        fail(f"cannot read {path} as text: {error}")
    loaded = GENERATORS[command].load(request)
    rendering = rendering_of(loaded.generate, name, text, loaded.inputs)
    return reasons(rendering, _names(request))


def _generator(path: Path) -> str:
    """Return the generator of a call, which the requesting core names, but FuseSoC's file does not."""
    call = read_call(path)
    generator = find_requesting_core(Path(call.files_root), call.vlnv.split(":")[2]).generator
    if generator not in GENERATORS:
        fail(
            f"no core in {call.files_root} generates {call.vlnv} any longer",
            hint="run 'fusesoc run --setup' to generate it again",
        )
    return generator


def _names(request: Request) -> Names:
    """Return the names that the lines of a generated core may contain."""
    if request.command == "far":
        loaded = load_requested(request)
        return names_of(loaded.specification, loaded.messages())
    return names_of(None, [(wanted.message, wanted.definitions) for wanted in order_of_request(request).messages])


def rendering_of(
    generate: Callable[[], GeneratedCore], name: str, text: str, inputs: Iterable[Input] = ()
) -> Rendering:
    """Return the template and context of the file `name` in a generated core with these `inputs`.

    Raise `InputError` if no template generated the file, or if the generated text differs from `text`.
    """
    with recorded() as renderings:
        core = generate()
    if name not in core.files:
        fail(f"'{name}' is not a file of the generated core", hint=f"the core's files: {', '.join(core.files)}")
    content = core.files[name].content
    made = content if isinstance(content, str) else content.decode(errors="replace")
    if made != text:
        fail(f"'{name}' is outdated or was edited", hint="run 'fusesoc run --setup' to generate it again")
    if made not in renderings:
        copied = [
            str(item)
            for item in inputs
            if isinstance(item, Path) and item.is_file() and item.read_bytes() == text.encode()
        ]
        fail(
            f"'{name}' was not generated from a template",
            hint=f"the file is a copy of {copied[0]}" if copied else "the file contains data",
        )
    return renderings[made]


def reasons(rendering: Rendering, names: Names) -> list[Reason]:
    """Return the origin of each line of a rendered file."""
    lines = traced_lines(rendering)
    text = "\n".join(line.text for line in lines)
    # The messages that the file is about, for fields without a block before them.
    own: dict[str, SourceRef] = {}
    for message, fields in names.messages.items():
        if re.search(rf"\b{re.escape(message)}\b", text):
            own |= fields
    return [_reason(line, rendering.context, names, own) for line in lines]


def names_of(specification: Specification | None, messages: Iterable[Message]) -> Names:
    """Return the names in a specification and in messages, which are given with all nested definitions."""
    fields = {str(name): dict(_fields(name, definitions)) for name, definitions in messages}
    blocks: dict[str, SourceRef] = {}
    of_blocks: dict[str, dict[str, SourceRef]] = {}
    for block in specification.blocks if specification else ():
        if block.name and block.name.source:
            word = identifier(block.name).lower()
            blocks[word] = block.name.source
            of_blocks[word] = {
                field: place
                for message in _messages(block.name, specification)
                for field, place in fields.get(message, {}).items()
            }
    return Names(blocks, of_blocks, fields)


def _messages(name: str, specification: Specification | None) -> Iterator[str]:
    """Yield the messages of a block, as named in the specification."""
    assert specification is not None
    types = {str(item.name): item for item in specification.accelerators}
    for block in specification.blocks:
        if block.name == name and block.message:
            yield str(block.message)
        elif block.name == name and block.type and (type_ := types.get(str(block.type))):
            yield from (str(side.message) for side in (*type_.interface.input, *type_.interface.output))


def _fields(
    name: MessageName, definitions: Definitions, above: tuple[str, ...] = ()
) -> Iterator[tuple[str, SourceRef]]:
    """Yield the port name of each field, including nested fields, and the name of each constant, with the place."""
    definition = definitions[name]
    for constant in definition.constants:
        yield constant.name.lower(), constant.source
    for field in definition.fields:
        path = (*above, field.name)
        yield identifier(*path).lower(), field.source
        if nested := nested_message(field.type):
            yield from _fields(nested, definitions, path)


def _reason(line: TracedLine, context: Mapping[str, object], names: Names, own: Mapping[str, SourceRef]) -> Reason:
    words = _words(line.text)
    blocks: dict[SourceRef, None] = {}
    fields: dict[SourceRef, None] = {}
    for word in words:
        if block := _block(word, names.blocks):
            blocks[names.blocks[block]] = None
            rest = _SIDE.sub("", word[len(block) + 1 :], count=1)
            if place := _longest(rest, names.fields[block]):
                fields[place] = None
    if not blocks:
        blocks = dict.fromkeys(_scope_blocks(line.scope, context, names))
        fields = {place: None for word in words if (place := own.get(word))}
    return Reason(line, tuple(blocks), tuple(fields))


def _scope_blocks(scope: str, context: Mapping[str, object], names: Names) -> list[SourceRef]:
    """Return the places of the blocks that the innermost scope with blocks names, except the whole file's scope."""
    data: object = context
    found: list[SourceRef] = []
    for key, number in _STEP.findall(scope):
        assert isinstance(data, Mapping)
        data = data[key]
        if number:
            assert isinstance(data, Sequence)
            data = data[int(number)]
        values = data.values() if isinstance(data, Mapping) else [data]
        words = [word for value in values if isinstance(value, str) for word in _words(value)]
        blocks = dict.fromkeys(block for word in words if (block := _block(word, names.blocks)))
        found = [names.blocks[block] for block in blocks] or found
    return found


def _words(text: str) -> list[str]:
    return [*dict.fromkeys(word.lower() for word in _WORD.findall(text))]


def _block(word: str, blocks: Iterable[str]) -> str | None:
    """Return the block whose signal or instance has this name, or None."""
    bare = word.removeprefix("u_")
    found = [block for block in blocks if bare == block or bare.startswith(f"{block}_")]
    return max(found, key=len, default=None)


def _longest(word: str, fields: Mapping[str, SourceRef]) -> SourceRef | None:
    """Return the place of the longest field name that begins a word; a suffix such as `_length` may follow the name."""
    found = [field for field in fields if word == field or word.startswith(f"{field}_")]
    return fields[max(found, key=len)] if found else None


def call_file(path: Path) -> tuple[Path, str]:
    """Return FuseSoC's file for the call that generated a file, and the file's name in the generated core.

    The file must be below `generator_cache`, or be a copy below `src`. Raise `InputError` if there is no such call.
    """
    path = path.absolute()
    places = [(folder, place) for folder in path.parents for place in (folder, *_caches(folder))]
    found = ((call, folder) for folder, place in places for call in sorted(place.glob("*_input.yml")))
    call, folder = next(found, (None, path))
    if call is None:
        fail(
            f"{path} is not a generated file",
            hint="in a build folder, generated files are below 'generator_cache' or in a folder <core>-<instance>",
        )
    return call, path.relative_to(folder).as_posix()


def _caches(folder: Path) -> list[Path]:
    """Return the folders in FuseSoC's generator cache for the core that was copied to `folder`."""
    if folder.parent.name != "src":
        return []
    return sorted((folder.parent.parent / "generator_cache").glob(f"{folder.name}-*"))
