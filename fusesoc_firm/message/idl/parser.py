"""Parse IDL text into messages.

    definition = module | struct | enum | const | typedef, each with ";"
    module     = "module" name "{" { definition } "}"
    struct     = { annotation } "struct" name "{" { { annotation } type declarator { "," declarator } ";" } "}"
    enum       = { annotation } "enum" name "{" { annotation } name { "," { annotation } name } "}"
    const      = "const" type name "=" expression
    typedef    = "typedef" ( type | struct | enum ) declarator { "," declarator }
    type       = number | "boolean" | "octet" | "char" | "string" [ "<" size ">" ] | "wstring" [ "<" size ">" ]
               | "sequence" "<" type [ "," size ] ">" | [ "::" ] name { "::" name }
    declarator = name [ "[" size "]" ]
    annotation = "@" name [ "(" ... ")" ]           `default`, `value` and `optional` have an effect

The struct `T` in the modules `pkg` and `msg` is the message `pkg/T`, whose constants are in the module `T_Constants`. A
type that the file does not declare is another message. After a fault, parsing continues at the next declaration.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

from fusesoc_firm.message.bounds import MOST_FILE_BYTES
from fusesoc_firm.message.dialect import IDL_NAME, LARGEST_SIZE
from fusesoc_firm.message.idl.expression import Expression
from fusesoc_firm.message.idl.names import Path, kind_of, message_name
from fusesoc_firm.message.idl.scope import Declared, Enum, Scope, twice
from fusesoc_firm.message.idl.tokens import MOST_NESTED, Cursor, IdlError, IdlText, Token
from fusesoc_firm.message.idl.values import Values
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    Constant,
    DefaultValue,
    ElementType,
    Field,
    FieldType,
    MessageName,
    MessageType,
    PrimitiveType,
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.parser import dialect_of
from fusesoc_firm.message.signature import ONLY_MEMBER
from fusesoc_firm.message.unsupported import IDL_FEATURES
from fusesoc_firm.text.diagnostics import Diagnostics

PRIMITIVES = {
    "boolean": PrimitiveType("bool"),
    "octet": PrimitiveType("byte"),
    "char": PrimitiveType("char", is_character=True),
    "float": PrimitiveType("float32"),
    "double": PrimitiveType("float64"),
    "short": PrimitiveType("int16"),
    "long": PrimitiveType("int32"),
    "long long": PrimitiveType("int64"),
    "unsigned short": PrimitiveType("uint16"),
    "unsigned long": PrimitiveType("uint32"),
    "unsigned long long": PrimitiveType("uint64"),
    **{
        name: PrimitiveType(name) for name in ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
    },
}
# On the wire, an enumerator is a number of 32 bits (DDS-XTypes 1.3, section 7.4).
_ENUMERATOR = PrimitiveType("int32")
_DECLARATIONS = "legal here: module, struct, enum, const, typedef"
# The annotations of members and enumerators that are not ignored.
_OF_MEMBERS = ("default", "optional")
_OF_ENUMERATORS = ("value",)


def parse_idl(
    text: str, package: str, ros: Middleware, file: str, diagnostics: Diagnostics
) -> dict[MessageName, MessageDefinition]:
    """Return the messages that IDL text defines; add faults to `diagnostics`.

    `package` is the package of structs outside all modules.
    """
    try:
        idl = IdlText(text, file)
    except IdlError as fault:
        diagnostics.error(fault.message, fault.source, fault.hint)
        return {}
    return _Parser(idl, package, ros, diagnostics).definitions()


@dataclass(frozen=True)
class _Annotation:
    """An annotation with an effect, and its value; None if it has none."""

    token: Token
    value: Scalar | None


@dataclass
class _Struct:
    """A struct: its modules, name, fields, and the enums of its fields."""

    modules: Path
    token: Token
    fields: list[Field] = field(default_factory=list)
    enums: dict[Enum, None] = field(default_factory=dict)


def _add_distinct(enumerator: Constant, enum: str, constants: dict[str, Constant]) -> None:
    """Add an enumerator to the constants of a message; the name of its enum, or a number, makes its name distinct."""
    name = enumerator.name
    while name in constants:
        name = f"{enum}_{name}" if name == enumerator.name else f"{name}_{len(constants)}"
    constants[name] = replace(enumerator, name=name)


class _Parser:
    """A recursive descent parser, which reports every fault and keeps the valid declarations."""

    def __init__(self, text: IdlText, package: str, ros: Middleware, diagnostics: Diagnostics) -> None:
        self._text = text
        self._package = package
        self._ros = ros
        self._diagnostics = diagnostics
        self._cursor = Cursor(text)
        self._scope = Scope(text)
        self._expression = Expression(self._cursor, self._scope.value_of)
        self._values = Values(text, dialect_of(ros))
        self._structs: list[_Struct] = []

    def definitions(self) -> dict[MessageName, MessageDefinition]:
        """Parse the whole text."""
        while self._cursor.token.kind != "end":
            self._declarations()
            if self._cursor.token.kind != "end":
                self._report("unexpected '}'", self._cursor.step())
        found: dict[MessageName, MessageDefinition] = {}
        constants = 0
        for struct in self._structs:
            definition = self._definition_of(struct)
            constants += len(definition.constants)
            if constants > MOST_FILE_BYTES:
                # Many structs with a field of one large enum would exhaust the memory.
                hint = f"legal here: up to {MOST_FILE_BYTES}"
                self._report("the messages of the file have too many constants together", struct.token, hint)
                break
            if definition.name in found:
                hint = f"the first one is in line {found[definition.name].source.line}"
                self._report(f"another struct defines the message '{definition.name}'", struct.token, hint)
            found.setdefault(definition.name, definition)
        return found

    def _definition_of(self, struct: _Struct) -> MessageDefinition:
        name = struct.token.text
        constants = {constant.name: constant for constant in self._scope.constants_of(struct.modules, name)}
        for enum in struct.enums:
            for enumerator in enum.enumerators:
                _add_distinct(enumerator, enum.name, constants)
        is_empty = [(item.name, item.type) for item in struct.fields] == [ONLY_MEMBER]
        return MessageDefinition(
            message_name(struct.modules, name, self._package),
            self._ros,
            () if is_empty else tuple(struct.fields),
            tuple(constants.values()),
            self._text.place(struct.token),
            kind_of(struct.modules),
            is_idl=True,
        )

    # --- declarations

    def _declarations(self) -> None:
        """Parse declarations up to a closing brace or the end; after a fault, continue after the next semicolon."""
        while self._cursor.token.kind != "end" and self._cursor.token.text != "}":
            try:
                self._declaration()
                self._cursor.expect(";")
            except IdlError as fault:
                self._recover(fault)

    def _declaration(self) -> None:
        self._annotations()
        word = self._cursor.step()
        match word.text:
            case "module":
                self._module()
            case "struct":
                self._struct()
            case "enum":
                self._enum()
            case "const":
                self._const()
            case "typedef":
                self._typedef()
            case _:
                self._refuse(word)
                found = f"'{word.text}'" if word.text else "the end of the file"
                raise self._text.fault(f"{found} does not begin a declaration", word, _DECLARATIONS)

    def _module(self) -> None:
        name = self._name()
        if len(self._scope.modules) == MOST_NESTED:
            raise self._text.fault("modules are nested too deeply", name, f"legal here: up to {MOST_NESTED} levels")
        self._cursor.expect("{")
        with self._scope.within(name.text):
            self._declarations()
        self._cursor.expect("}")

    def _struct(self) -> Declared:
        name = self._name()
        modules = self._scope.modules
        declared = Declared(MessageType(message_name(modules, name.text, self._package)))
        if self._cursor.token.text == ";":
            self._scope.announce(name, declared)
            return declared
        if self._cursor.token.text == ":":
            self._refuse(self._cursor.token)
        self._scope.declare(name)
        self._scope.announce(name, declared)
        self._cursor.expect("{")
        struct = _Struct(modules, name)
        self._scope.struct = name.text
        self._members(struct)
        self._cursor.expect("}")
        self._structs.append(struct)
        return declared

    def _members(self, struct: _Struct) -> None:
        known: dict[str, Token] = {}
        if self._cursor.token.text == "}":
            hint = f"write 'uint8 {ONLY_MEMBER[0]};', as ROS 2 does for a message without fields"
            self._report(f"struct '{struct.token.text}' has no members", struct.token, hint)
        while self._cursor.token.kind != "end" and self._cursor.token.text != "}":
            try:
                self._member(struct, known)
            except IdlError as fault:
                self._recover(fault)

    def _member(self, struct: _Struct, known: dict[str, Token]) -> None:
        annotations = self._annotations(_OF_MEMBERS)
        if (optional := annotations.get("optional")) and optional.value is not False:
            self._refuse(optional.token)
        first = self._cursor.token
        declared = self._type()
        source = self._text.place(first, self._cursor.last)
        while True:
            name = self._name()
            kind = self._sized(declared.type)
            if name.text in known:
                raise twice(self._text, name, known[name.text])
            known[name.text] = name
            struct.fields.append(Field(name.text, kind, source, self._default(annotations.get("default"), kind)))
            if declared.enum:
                struct.enums[declared.enum] = None
            if not self._cursor.accept(","):
                break
        self._cursor.expect(";")

    def _enum(self) -> Declared:
        name = self._name()
        enum = Enum(name.text)
        declared = Declared(_ENUMERATOR, enum)
        self._scope.add_type(name, declared)
        self._cursor.expect("{")
        try:
            self._enumerator(enum.enumerators)
            while self._cursor.accept(","):
                self._enumerator(enum.enumerators)
            if self._cursor.token.text == "=":
                self._refuse(self._cursor.token)
        except IdlError as fault:
            self._diagnostics.error(fault.message, fault.source, fault.hint)
            while self._cursor.token.kind != "end" and self._cursor.token.text != "}":
                self._cursor.step()
        self._cursor.expect("}")
        self._scope.add_enum(name, enum)
        return declared

    def _enumerator(self, before: list[Constant]) -> None:
        """Parse an enumerator, whose value is the successor of the one before, and add it to `before`."""
        given = self._annotations(_OF_ENUMERATORS).get("value")
        name = self._name()
        value: Scalar = int(before[-1].value) + 1 if before else 0
        if given and given.value is not None:
            value = given.value
        value = self._values.scalar(value, _ENUMERATOR, given.token if given else name)
        enumerator = Constant(name.text, _ENUMERATOR, value, str(value), self._text.place(name))
        self._scope.add_constant(name, enumerator)
        before.append(enumerator)

    def _const(self) -> None:
        first = self._cursor.token
        kind = self._type().type
        if not isinstance(kind, PrimitiveType | StringType):
            raise self._text.fault(
                f"a constant cannot have the type '{first.text}'", first, "legal here: numbers and strings"
            )
        source = self._text.place(first, self._cursor.last)
        name = self._name()
        self._cursor.expect("=")
        token = self._cursor.token
        value = self._values.scalar(self._expression.read(), kind, token)
        self._scope.add_constant(name, Constant(name.text, kind, value, str(value), source))

    def _typedef(self) -> None:
        match self._cursor.token.text:
            case "struct":
                self._cursor.step()
                declared = self._struct()
            case "enum":
                self._cursor.step()
                declared = self._enum()
            case _:
                declared = self._type()
        while True:
            name = self._name()
            self._scope.add_type(name, Declared(self._sized(declared.type), declared.enum))
            if not self._cursor.accept(","):
                break

    # --- types

    def _type(self, depth: int = 0) -> Declared:
        """Return the type that is next."""
        token = self._cursor.token
        if token.text in ("long", "unsigned", *PRIMITIVES):
            return Declared(self._primitive())
        if token.text in ("string", "wstring"):
            self._cursor.step()
            bound = self._size(">", "<") if self._cursor.token.text == "<" else None
            return Declared(StringType(token.text == "wstring", bound))
        if token.text == "sequence" and self._cursor.following.text == "<":
            return self._sequence(depth)
        self._refuse(token)
        is_absolute, words = self._cursor.scoped_name()
        if declared := self._scope.type_of(is_absolute, words):
            return declared
        modules = words[:-1] or self._scope.modules
        return Declared(MessageType(message_name(modules, words[-1], self._package)))

    def _primitive(self) -> PrimitiveType:
        first = self._cursor.step()
        words = [first.text]
        while words[-1] in ("long", "unsigned") and self._cursor.token.text in ("long", "short") and len(words) < 3:
            words.append(self._cursor.step().text)
        if words == ["long"] and self._cursor.token.text == "double":
            self._refuse(first, "long double")
        name = " ".join(words)
        if name not in PRIMITIVES:
            raise self._text.fault(f"'{name}' is not a type", first, f"legal here: {', '.join(PRIMITIVES)}")
        return PRIMITIVES[name]

    def _sequence(self, depth: int) -> Declared:
        token = self._cursor.step()
        if depth == MOST_NESTED:
            raise self._text.fault("sequences are nested too deeply", token, f"legal here: up to {MOST_NESTED} levels")
        self._cursor.expect("<")
        self._annotations()
        declared = self._type(depth + 1)
        bound = None
        if self._cursor.token.text == ",":
            bound = self._size(">", ",")
        else:
            self._cursor.expect(">")
        return Declared(SequenceType(self._element(declared.type, token), bound), declared.enum)

    def _sized(self, kind: FieldType) -> FieldType:
        """Return the type of a declarator, after its name."""
        bracket = self._cursor.token
        if bracket.text != "[":
            return kind
        length = self._size("]", "[")
        if self._cursor.token.text == "[":
            self._refuse(self._cursor.token)
        return ArrayType(self._element(kind, bracket), length)

    def _element(self, kind: FieldType, token: Token) -> ElementType:
        if isinstance(kind, ArrayType | SequenceType):
            self._refuse(token, "[")
        assert not isinstance(kind, ArrayType | SequenceType)
        return kind

    def _size(self, end: str, begin: str) -> int:
        self._cursor.expect(begin)
        token = self._cursor.token
        size = self._expression.read(is_in_brackets=end == ">")
        if isinstance(size, bool) or not isinstance(size, int) or not 1 <= size <= LARGEST_SIZE:
            hint = f"legal here: whole numbers from 1 to {LARGEST_SIZE}"
            raise self._text.fault(f"'{size}' is not a legal size", token, hint)
        self._cursor.expect(end)
        return size

    # --- names and values

    def _name(self) -> Token:
        """Return the name that is declared next."""
        token = self._cursor.token
        self._cursor.word("a name")
        if not IDL_NAME.accepts(token.text):
            raise self._text.fault(IDL_NAME.fault(token.text, "IDL"), token, IDL_NAME.hint)
        return token

    def _annotations(self, effective: Collection[str] = ()) -> dict[str, _Annotation]:
        """Parse annotations, and return those with an effect here."""
        found = {}
        while self._cursor.token.text == "@":
            token = self._cursor.step()
            _, words = self._cursor.scoped_name()
            self._refuse(token, f"@{words[0]}" if words == ("annotation",) else "")
            has_effect = words[0] in effective and len(words) == 1
            value = None
            if self._cursor.token.text == "(":
                if has_effect:
                    value = self._parameter()
                else:
                    self._skip_parameters()
            if has_effect:
                found[words[0]] = _Annotation(Token(token.kind, f"@{words[0]}", token.start), value)
        return found

    def _parameter(self) -> Scalar:
        """Return the value in `(value)` or `(value=value)`."""
        self._cursor.expect("(")
        if self._cursor.token.text == "value" and self._cursor.following.text == "=":
            self._cursor.step()
            self._cursor.step()
        value = self._expression.read()
        self._cursor.expect(")")
        return value

    def _skip_parameters(self) -> None:
        depth = 0
        while True:
            token = self._cursor.step()
            depth += {"(": 1, ")": -1}.get(token.text, 0)
            if depth == 0:
                return
            if token.kind == "end":
                raise self._text.fault("expected ')' before the end of the file", token)

    def _default(self, given: _Annotation | None, kind: FieldType) -> DefaultValue | None:
        return None if given is None or given.value is None else self._values.default(given.value, kind, given.token)

    # --- faults

    def _refuse(self, token: Token, word: str = "") -> None:
        """Raise `IdlError` if a word or mark belongs to a feature that is not supported."""
        if feature := IDL_FEATURES.get(word or token.text):
            raise self._text.fault(f"{feature.name} are not supported in .idl files", token, feature.hint)

    def _report(self, message: str, token: Token, hint: str = "") -> None:
        self._diagnostics.error(message, self._text.place(token), hint)

    def _recover(self, fault: IdlError) -> None:
        """Report a fault, and go to the end of the declaration: after its semicolon, or before a closing brace."""
        self._diagnostics.error(fault.message, fault.source, fault.hint)
        depth = 0
        while self._cursor.token.kind != "end":
            text = self._cursor.token.text
            if text == "}" and depth == 0:
                return
            depth += {"{": 1, "}": -1}.get(text, 0)
            self._cursor.step()
            if text == ";" and depth == 0:
                return
