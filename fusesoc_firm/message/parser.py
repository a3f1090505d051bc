r"""Parse `.msg` text; the parser in rosbags loses defaults and reports no line and column for errors.

    line        = [ declaration ] [ "#" comment ]
    declaration = type name [ default ]             a field; defaults: ROS 2
                | primitive name "=" value          a constant; in ROS 1 a string takes the rest, "#" included
    type        = element [ "[" [ [ "<=" ] size ] "]" ]
    element     = primitive | string [ "<=" size ] | [ package "/" [ "msg/" ] ] message
    default     = scalar | "[" [ scalar { "," scalar } ] "]"

`dialect` lists the differences between the versions. In both, a line with "=" after its first word is a constant. Each
line is parsed separately, so a faulty line does not hide faults in later lines.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from fusesoc_firm.message.dialect import LARGEST_SIZE, Dialect, NameRule
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    Constant,
    DefaultValue,
    ElementType,
    Field,
    FieldType,
    InterfaceKind,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.piece import Piece, read_lines
from fusesoc_firm.message.unsupported import unsupported_form, unsupported_word
from fusesoc_firm.message.values import read_default, read_value
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, fail, nearest

_SEPARATOR = "---"
_NAME = re.compile(r"([A-Za-z][A-Za-z0-9_]*)(?:/(msg|srv|action))?/([A-Za-z][A-Za-z0-9_]*)")
_TYPE = re.compile(r"([^\[\]]+)(?:\[([^\[\]]*)\])?")


def parse_name(text: str) -> MessageName:
    """Parse `pkg/Type`, `pkg/msg/Type` or, for messages of services and actions, `pkg/srv/Type_Request`."""
    return parse_full_name(text)[1]


def parse_full_name(text: str) -> tuple[InterfaceKind | None, MessageName]:
    """Parse a name like `parse_name`, and also return the kind in the text, or None."""
    match = _NAME.fullmatch(text.strip())
    if match is None:
        fail(f"'{text}' is not a message name", hint="write 'package/Type', such as 'geometry_msgs/Quaternion'")
    package, kind, name = match.groups()
    return InterfaceKind(kind) if kind else None, MessageName(package, name)


def dialect_of(ros: Middleware) -> Dialect:
    """Return the rules of a middleware's `.msg` files."""
    assert ros.dialect is not None, f"{ros.title} has no .msg files"
    return ros.dialect


def parse_message(
    text: str, name: MessageName, ros: Middleware, file: str, diagnostics: Diagnostics
) -> MessageDefinition:
    """Parse the text of a `.msg` file; add faults to `diagnostics`, and return the valid parts."""
    return _parse_lines(read_lines(text, file), name, ros, file, diagnostics)


def parse_sections(
    text: str, names: Sequence[MessageName], ros: Middleware, file: str, diagnostics: Diagnostics
) -> list[MessageDefinition]:
    """Parse a `.srv` or `.action` file into one definition for each of `names`; `---` separates the sections."""
    sections: list[list[Piece]] = [[]]
    for line in read_lines(text, file):
        if not line.text.startswith(_SEPARATOR):
            sections[-1].append(line)
        elif len(sections) < len(names):
            sections.append([])
        else:
            diagnostics.error(f"the file has more than the {len(names)} expected sections", line.source)
    if len(sections) < len(names):
        diagnostics.error(
            f"the file has {len(sections)} of the {len(names)} expected sections",
            SourceRef(file, 1, 1),
            f"'{_SEPARATOR}' separates sections",
        )
    return [_parse_lines(section, name, ros, file, diagnostics) for section, name in zip(sections, names, strict=False)]


def service_names(name: MessageName, ros: Middleware) -> tuple[MessageName, ...]:
    """Return the names of a service's request and response in this middleware."""
    return _derived_names(name, ros, ("Request", "Response"))


def action_names(name: MessageName, ros: Middleware) -> tuple[MessageName, ...]:
    """Return the names of an action's goal, result and feedback in this middleware."""
    return _derived_names(name, ros, ("Goal", "Result", "Feedback"))


def _derived_names(name: MessageName, ros: Middleware, suffixes: Iterable[str]) -> tuple[MessageName, ...]:
    return tuple(MessageName(name.package, f"{name.name}{dialect_of(ros).joint}{suffix}") for suffix in suffixes)


def _parse_lines(
    lines: Iterable[Piece], name: MessageName, ros: Middleware, file: str, diagnostics: Diagnostics
) -> MessageDefinition:
    source, dialect = SourceRef(file, 1, 1), dialect_of(ros)
    for rule, word in ((dialect.package_name, name.package), (dialect.message_name, name.name)):
        if not rule.accepts(word):
            diagnostics.error(rule.fault(word, dialect.title), source, rule.hint)
    reader = _Reader(name, dialect, diagnostics)
    for line in lines:
        reader.read(line)
    return MessageDefinition(name, ros, tuple(reader.fields), tuple(reader.constants), source)


class _Reader:
    """A parser for the lines of one message, which reports every fault and keeps the valid declarations."""

    def __init__(self, name: MessageName, dialect: Dialect, diagnostics: Diagnostics) -> None:
        self.fields: list[Field] = []
        self.constants: list[Constant] = []
        self._package = name.package
        self._dialect = dialect
        self._diagnostics = diagnostics
        self._first_line: dict[str, int] = {}

    def read(self, line: Piece) -> None:
        """Parse one line."""
        code, _ = line.partition("#")
        if not code.text:
            return
        if code.text.startswith("//"):
            self._diagnostics.error("'//' does not begin a comment", code.source, "a comment begins with '#'")
            return
        if unsupported := unsupported_form(code):
            feature, part = unsupported
            self._diagnostics.error(feature.fault, part.source, feature.hint)
            return
        kind, rest = code.split_word()
        if not rest.text:
            self._diagnostics.error(
                f"'{kind.text}' is not followed by a name", kind.source, "a field has the form 'type name'"
            )
        elif "=" in rest.text:
            self._read_constant(kind, rest, line)
        else:
            self._read_field(kind, rest)

    def _read_field(self, kind: Piece, rest: Piece) -> None:
        name, default = rest.split_word()
        if name.text.startswith("["):
            joined = f"{kind.text}{name.text}"
            self._diagnostics.error(
                "unexpected blank before '['", name.source, f"write the type as one word: '{joined}'"
            )
            return
        dialect = self._dialect
        if default.text and dialect.constant_name.accepts(name.text) and not dialect.field_name.accepts(name.text):
            hint = f"write '{kind.text} {name.text}={default.text}'"
            self._diagnostics.error(f"'=' is missing after constant '{name.text}'", default.source, hint)
            return
        field_type = self._type(kind)
        is_named = self._check_name(name, dialect.field_name)
        value = self._default(default, name, field_type) if default.text else None
        is_whole = value is not None or not default.text
        if field_type is not None and is_named and is_whole:
            self.fields.append(Field(name.text, field_type, kind.source, value))

    def _default(self, default: Piece, name: Piece, field_type: FieldType | None) -> DefaultValue | None:
        if not self._dialect.has_defaults:
            self._diagnostics.error(
                f"unexpected '{default.text}' after field '{name.text}'",
                default.source,
                f"{self._dialect.title} has no default values; a constant has the form 'type NAME=value'",
            )
            return None
        return None if field_type is None else read_default(default, field_type, self._dialect, self._diagnostics)

    def _read_constant(self, kind: Piece, rest: Piece, line: Piece) -> None:
        name, value = rest.partition("=")
        constant_type = self._constant_type(kind)
        is_named = self._check_name(name, self._dialect.constant_name)
        if constant_type is None:
            return
        if isinstance(constant_type, StringType) and not self._dialect.has_comments_behind_strings:
            value = line.part(value.start).strip()
        scalar = read_value(value, constant_type, self._dialect, self._diagnostics)
        if scalar is not None and is_named:
            self.constants.append(Constant(name.text, constant_type, scalar, value.text, kind.source))

    def _constant_type(self, kind: Piece) -> PrimitiveType | StringType | None:
        if kind.text in self._dialect.strings:
            return StringType(kind.text == "wstring")
        if kind.text in self._dialect.primitives - self._dialect.opaque_primitives:
            return PrimitiveType(kind.text)
        self._diagnostics.error(
            f"a constant cannot have the type '{kind.text}'", kind.source, "legal here: numbers, bool and strings"
        )
        return None

    def _check_name(self, name: Piece, rule: NameRule) -> bool:
        if not rule.accepts(name.text):
            # This case includes a default such as `s "a=b"`: the reference parser also treats the line as a constant.
            is_default = len(name.text.split()) > 1
            hint = "a line with '=' declares a constant, even if the '=' is in quotes" if is_default else rule.hint
            self._diagnostics.error(rule.fault(name.text, self._dialect.title), name.source, hint)
            return False
        if first := self._first_line.get(name.text):
            self._diagnostics.error(
                f"'{name.text}' is declared twice", name.source, f"the first declaration is in line {first}"
            )
            return False
        self._first_line[name.text] = name.line
        return True

    def _type(self, kind: Piece) -> FieldType | None:
        match = _TYPE.fullmatch(kind.text)
        if match is None:
            forms = "'T', 'T[]', 'T[3]' or 'T[<=3]'" if self._dialect.has_bounds else "'T', 'T[]' or 'T[3]'"
            self._diagnostics.error(f"'{kind.text}' is not a type", kind.source, f"a type has the form {forms}")
            return None
        is_array = match[2] is not None
        element = self._element(kind.part(*match.span(1)), is_array)
        if not is_array:
            return element
        size = kind.part(*match.span(2))
        if not size.text:
            return SequenceType(element) if element else None
        return self._sized_array(element, size)

    def _sized_array(self, element: ElementType | None, size: Piece) -> FieldType | None:
        if size.text.startswith("<="):
            bound = self._bound(size)
            return SequenceType(element, bound) if element and bound is not None else None
        length = self._size(size, self._dialect.smallest_array)
        return ArrayType(element, length) if element and length is not None else None

    def _bound(self, piece: Piece) -> int | None:
        """Return the number after the `<=` at the start of `piece`, or None if a fault was reported."""
        if not self._dialect.has_bounds:
            self._diagnostics.error(
                f"{self._dialect.title} does not support bounds such as '{piece.text}'", piece.source
            )
            return None
        return self._size(piece.part(2), smallest=1)

    def _size(self, piece: Piece, smallest: int) -> int | None:
        digits = piece.text.lstrip("0") or "0"
        # Python refuses to convert numbers with thousands of digits, so the length is checked first.
        is_short = piece.text.isascii() and piece.text.isdigit() and len(digits) <= len(str(LARGEST_SIZE))
        if is_short and smallest <= int(digits) <= LARGEST_SIZE:
            return int(digits)
        hint = f"legal here: whole numbers from {smallest} to {LARGEST_SIZE}"
        self._diagnostics.error(f"'{piece.text}' is not a legal size", piece.source, hint)
        return None

    def _element(self, piece: Piece, is_array: bool) -> ElementType | None:
        word, dialect = piece.text, self._dialect
        if word in dialect.primitives:
            return PrimitiveType(word)
        if word in dialect.strings:
            return StringType(word == "wstring")
        if word in dialect.shorthands and (dialect.has_array_shorthands or not is_array):
            return MessageType(dialect.shorthands[word])
        base, _, _ = word.partition("<=")
        if base != word and base in ("string", "wstring"):
            size = self._bound(piece.part(len(base)))
            return None if size is None else StringType(base == "wstring", size)
        return self._message_type(piece)

    def _message_type(self, piece: Piece) -> MessageType | None:
        parts = piece.text.split("/")
        if len(parts) == 3 and parts[1] == "msg" and self._dialect.has_long_types:
            del parts[1]
        package, name = (self._package, parts[0]) if len(parts) == 1 else (parts[0], "/".join(parts[1:]))
        is_package = len(parts) == 1 or self._dialect.package_name.accepts(package)
        if is_package and self._dialect.message_name.accepts(name):
            return MessageType(MessageName(package, name))
        if feature := unsupported_word(piece.text):
            self._diagnostics.error(feature.fault, piece.source, feature.hint)
            return None
        hint = nearest(piece.text, self._dialect.builtin_types) if len(parts) == 1 else self._message_hint(is_package)
        self._diagnostics.error(f"unknown type '{piece.text}'", piece.source, hint)
        return None

    def _message_hint(self, is_package: bool) -> str:
        rule = self._dialect.message_name if is_package else self._dialect.package_name
        return f"a message type has the form 'package/Type'; {rule.hint}"
