"""The text of a message at each stage from the definition to the hardware.

Each stage imports only the modules that it needs, so that `firm message show` starts quickly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from fusesoc_firm.text.yaml_text import yaml_dump

if TYPE_CHECKING:
    from fusesoc_firm.converter.sources import Artifact
    from fusesoc_firm.message.library import MessageLibrary
    from fusesoc_firm.message.middleware import Definitions
    from fusesoc_firm.message.model import MessageName
    from fusesoc_firm.message.services import Interface


def stages_text(stage: str, library: MessageLibrary, type_: str, width: int) -> str:
    """Return the text of a message, or of the messages of a service or action, at one of `STAGES`; no final newline.

    `width` is the width of the converters' stream in bits. May raise `InputError`.
    """
    from fusesoc_firm.message.parser import parse_full_name

    kind, name = parse_full_name(type_)
    interface = library.interface(name, kind)
    names = interface.messages if interface else (name,)
    definitions = library.joint_closure(names)
    texts = [STAGES[stage](each, definitions, width) for each in names]
    if interface and stage == "message":
        texts.insert(0, _title(interface, definitions))
    separator = "\n---\n" if stage in _YAML else "\n\n"
    return separator.join(text.rstrip("\n") for text in texts)


def _title(interface: Interface, definitions: Definitions) -> str:
    """Return the heading of a message of a service or an action."""
    from fusesoc_firm.message.signature import signature

    title = f"# {interface} ({interface.ros.title})"
    if not interface.has_signature:
        return title
    return f"{title}\n# signature: {signature(interface.name, definitions, interface.kind)}"


def _tree(name: MessageName, definitions: Definitions, _: int) -> str:
    from fusesoc_firm.frame import tree
    from fusesoc_firm.frame.layout import frame_of

    return tree.text(tree.rows(name, definitions, frame_of(name, definitions)))


def _message(name: MessageName, definitions: Definitions, _: int) -> str:
    from fusesoc_firm.message.printer import to_text
    from fusesoc_firm.message.signature import signature

    return to_text(definitions[name], signature(name, definitions))


def _frame(name: MessageName, definitions: Definitions, _: int) -> str:
    from fusesoc_firm.frame.description import description
    from fusesoc_firm.frame.layout import frame_of

    return yaml_dump(description(frame_of(name, definitions)))


def _configuration(name: MessageName, definitions: Definitions, width: int) -> str:
    return "---\n".join(yaml_dump(source.configuration) for source in _sources(name, definitions, width))


def _vhdl(name: MessageName, definitions: Definitions, width: int) -> str:
    return "\n".join(source.text for source in _sources(name, definitions, width))


def _sources(name: MessageName, definitions: Definitions, width: int) -> Iterator[Artifact]:
    """Yield the message's package of constants, and both converters."""
    from fusesoc_firm.converter.sources import constants_sources, publisher_source, subscriber_source
    from fusesoc_firm.frame.layout import frame_of

    frame = frame_of(name, definitions)
    yield from constants_sources([(name, definitions)])
    yield subscriber_source(frame, width)
    yield publisher_source(frame, width)


STAGES: Mapping[str, Callable[[MessageName, Definitions, int], str]] = {
    "tree": _tree,
    "message": _message,
    "frame": _frame,
    "config": _configuration,
    "vhdl": _vhdl,
}
"""For each stage's name, a function of a message, its definitions and the stream width that returns the text."""
_YAML = ("frame", "config")
