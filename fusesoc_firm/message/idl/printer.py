"""Print a message as an `.idl` file, which `parser.py` reads back as the same message.

The bags that we write contain such text if a message comes from an `.idl` file, since `.msg` text cannot express the
names and the `char` of IDL.
"""

from __future__ import annotations

import math

from fusesoc_firm.message.idl.names import constants_module
from fusesoc_firm.message.idl.parser import PRIMITIVES
from fusesoc_firm.message.middleware import Definitions, MessageDefinition
from fusesoc_firm.message.model import (
    ArrayType,
    Constant,
    DefaultValue,
    ElementType,
    Field,
    MessageType,
    PrimitiveType,
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.signature import ONLY_MEMBER
from fusesoc_firm.text.diagnostics import SourceRef

_WORDS = {kind: word for word, kind in PRIMITIVES.items()} | {PrimitiveType("char"): "uint8"}


def to_idl(definition: MessageDefinition, definitions: Definitions) -> str:
    """Return the text of an `.idl` file; `definitions` contains the nested messages."""
    name = definition.name
    lines = [f"module {name.package} {{", f"  module {definition.kind} {{"]
    if definition.constants:
        lines.append(f"    module {constants_module(name.name)} {{")
        lines += [f"      {_constant(constant)}" for constant in definition.constants]
        lines.append("    };")
    lines.append(f"    struct {name.name} {{")
    for field in definition.fields or [Field(*ONLY_MEMBER, SourceRef("", 1, 1))]:
        lines += [f"      {line}" for line in _field(field, definitions)]
    return "\n".join([*lines, "    };", "  };", "};", ""])


def _constant(constant: Constant) -> str:
    kind = constant.type
    # A string constant has the length of its value, so its bound is not printed.
    word = _element(kind, {}) if isinstance(kind, PrimitiveType) else "wstring" if kind.is_wide else "string"
    is_character = isinstance(kind, PrimitiveType) and kind.is_character
    value = _literal(chr(int(constant.value))) if is_character else _scalar(constant.value)
    return f"const {word} {constant.name} = {value};"


def _literal(character: str) -> str:
    # rosbags reads no other characters than letters and digits.
    return f"'{character}'" if character.isascii() and character.isalnum() else f"'\\x{ord(character):02x}'"


def _field(field: Field, definitions: Definitions) -> list[str]:
    default = _default(field.default)
    annotation = [f"@default (value={default})"] if default else []
    match field.type:
        case ArrayType(element, length):
            return [*annotation, f"{_element(element, definitions)} {field.name}[{length}];"]
        case SequenceType(element, bound):
            limit = "" if bound is None else f", {bound}"
            return [*annotation, f"sequence<{_element(element, definitions)}{limit}> {field.name};"]
    return [*annotation, f"{_element(field.type, definitions)} {field.name};"]


def _element(kind: ElementType, definitions: Definitions) -> str:
    match kind:
        case MessageType(name):
            return f"{name.package}::{definitions[name].kind}::{name.name}"
        case StringType(is_wide, bound):
            return ("wstring" if is_wide else "string") + ("" if bound is None else f"<{bound}>")
    return _WORDS[kind]


def _default(value: DefaultValue | None) -> str:
    if isinstance(value, tuple):
        # Python has no literal for NaN.
        elements = [_scalar(item) if isinstance(item, float) else repr(item) for item in value]
        is_literal = not any(isinstance(item, float) and math.isnan(item) for item in value)
        end = "," if len(value) == 1 else ""
        return _scalar(f"({', '.join(elements)}{end})") if is_literal else ""
    return "" if value is None else _scalar(value)


def _scalar(value: Scalar) -> str:
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, str):
        return f'"{"".join(map(_character, value))}"'
    if isinstance(value, float) and not math.isfinite(value):
        # IDL has no words for these values; a literal beyond the range of a double is infinite.
        return "1e999 - 1e999" if math.isnan(value) else "1e999" if value > 0 else "-1e999"
    return repr(value)


def _character(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    return character if character.isprintable() or ord(character) > 255 else f"\\{ord(character):03o}"
