"""Parse `.idl` files and the `ros2idl` schemas of bags: the part of OMG IDL 4.2 that rosidl accepts, and enums.

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

import ast
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from fusesoc_firm.message.dialect import IDL_NAME, LARGEST_SIZE
from fusesoc_firm.message.idl_expression import MOST_NESTED, Cursor, Expression
from fusesoc_firm.message.idl_tokens import IdlError, IdlText, Token
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
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.signature import ONLY_MEMBER
from fusesoc_firm.message.unsupported import IDL_FEATURES
from fusesoc_firm.message.values import scalar_of
from fusesoc_firm.text.diagnostics import Diagnostics

SUFFIX = "idl"
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
_KINDS = {kind.value: kind for kind in InterfaceKind}
_PARTS = {InterfaceKind.SERVICE: ("_Request", "_Response"), InterfaceKind.ACTION: ("_Goal", "_Result", "_Feedback")}
# The annotations of members and enumerators that are not ignored.
_OF_MEMBERS = ("default", "optional")
_OF_ENUMERATORS = ("value",)

_Path = tuple[str, ...]
_T = TypeVar("_T")


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


def declared_in(text: str, package: str) -> list[tuple[InterfaceKind, MessageName]]:
    """Return the messages, services and actions that IDL text declares; the text is not checked."""
    try:
        tokens = IdlText(text, "").tokens
    except IdlError:
        return []
    structs = list(_structs(tokens))
    found = (_declared(modules, name, package, structs) for modules, name in structs)
    return list(dict.fromkeys(found))


def _structs(tokens: Sequence[Token]) -> Iterator[tuple[_Path, str]]:
    """Yield the modules and the name of each struct with members."""
    scopes: list[str | None] = []
    for word, name, mark in zip(tokens, tokens[1:], tokens[2:], strict=False):
        if word.text == "}" and scopes:
            scopes.pop()
        elif mark.text == "{" and word.text == "module":
            scopes.append(name.text)
        elif mark.text in ("{", ":") and word.text == "struct" and name.kind == "word":
            yield tuple(scope for scope in scopes if scope), name.text
        if mark.text == "{" and word.text != "module":
            scopes.append(None)


def _declared(
    modules: _Path, name: str, package: str, structs: Collection[tuple[_Path, str]]
) -> tuple[InterfaceKind, MessageName]:
    """Return the service or action of which a struct is a part, if all its parts are declared, or else the message."""
    kind, message = _kind_of(modules), _message_name(modules, name, package)
    for part in _PARTS.get(kind, ()):
        base = name.removesuffix(part)
        if base != name and all((modules, f"{base}{other}") in structs for other in _PARTS[kind]):
            return kind, MessageName(message.package, base)
    return InterfaceKind.MESSAGE, message


def _kind_of(modules: _Path) -> InterfaceKind:
    return _KINDS.get(modules[1], InterfaceKind.MESSAGE) if len(modules) > 1 else InterfaceKind.MESSAGE


def constants_module(struct: str) -> str:
    """Return the name of the module with a struct's constants."""
    return f"{struct}_Constants"


def _message_name(modules: _Path, name: str, package: str) -> MessageName:
    """Return the name of the message that a struct defines; modules below those of ROS are a part of the name."""
    below = modules[2:] if len(modules) > 1 and modules[1] in _KINDS else modules[1:]
    return MessageName(modules[0] if modules else package, "_".join((*below, name)))


@dataclass(frozen=True)
class _Declared:
    """A type with a name, and the enumerators that it brings into a message."""

    type: FieldType
    enumerators: tuple[Constant, ...] = ()


@dataclass(frozen=True)
class _Annotation:
    """An annotation with an effect, and its value; None if it has none."""

    token: Token
    value: Scalar | None


_Annotations = dict[str, _Annotation]


@dataclass
class _Struct:
    """A struct: its modules, name, fields, and the enumerators of its fields."""

    modules: _Path
    token: Token
    fields: list[Field] = field(default_factory=list)
    enumerators: list[Constant] = field(default_factory=list)


class _Parser:
    """A recursive descent parser, which reports every fault and keeps the valid declarations."""

    def __init__(self, text: IdlText, package: str, ros: Middleware, diagnostics: Diagnostics) -> None:
        self._text = text
        self._package = package
        self._ros = ros
        self._diagnostics = diagnostics
        self._cursor = Cursor(text)
        self._expression = Expression(self._cursor, self._value_of)
        self._modules: list[str] = []
        # The module with the constants of the struct that is parsed, in which rosidl looks up names as well.
        self._own_constants = ""
        self._types: dict[_Path, _Declared] = {}
        self._constants: dict[_Path, Constant] = {}
        self._structs: list[_Struct] = []
        self._places: dict[_Path, Token] = {}

    def definitions(self) -> dict[MessageName, MessageDefinition]:
        """Parse the whole text."""
        while self._cursor.token.kind != "end":
            self._declarations()
            if self._cursor.token.kind != "end":
                self._report("unexpected '}'", self._cursor.step())
        found: dict[MessageName, MessageDefinition] = {}
        for struct in self._structs:
            definition = self._definition_of(struct)
            if definition.name in found:
                hint = f"the first one is in line {found[definition.name].source.line}"
                self._report(f"another struct defines the message '{definition.name}'", struct.token, hint)
            found.setdefault(definition.name, definition)
        return found

    def _definition_of(self, struct: _Struct) -> MessageDefinition:
        scope = (*struct.modules, constants_module(struct.token.text))
        own = [constant for path, constant in self._constants.items() if path[:-1] == scope]
        constants = {constant.name: constant for constant in own}
        for enumerator in struct.enumerators:
            constants.setdefault(enumerator.name, enumerator)
        name = _message_name(struct.modules, struct.token.text, self._package)
        fields = () if [(item.name, item.type) for item in struct.fields] == [ONLY_MEMBER] else tuple(struct.fields)
        source = self._text.place(struct.token)
        kind = _kind_of(struct.modules)
        return MessageDefinition(name, self._ros, fields, tuple(constants.values()), source, kind, is_idl=True)

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
        if len(self._modules) == MOST_NESTED:
            raise self._text.fault("modules are nested too deeply", name, f"legal here: up to {MOST_NESTED} levels")
        self._cursor.expect("{")
        self._modules.append(name.text)
        try:
            self._declarations()
        finally:
            self._modules.pop()
        self._cursor.expect("}")

    def _struct(self) -> _Declared:
        name = self._name()
        modules = tuple(self._modules)
        declared = _Declared(MessageType(_message_name(modules, name.text, self._package)))
        if self._cursor.token.text == ";":
            self._types.setdefault((*modules, name.text), declared)
            return declared
        if self._cursor.token.text == ":":
            self._refuse(self._cursor.token)
        self._declare(name)
        self._types[*modules, name.text] = declared
        self._cursor.expect("{")
        self._own_constants = constants_module(name.text)
        struct = _Struct(modules, name)
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
                raise self._twice(name, known[name.text])
            known[name.text] = name
            default = self._default(annotations.get("default"), kind)
            struct.fields.append(Field(name.text, kind, source, default))
            struct.enumerators += declared.enumerators
            if not self._cursor.accept(","):
                break
        self._cursor.expect(";")

    def _enum(self) -> _Declared:
        enum = self._name()
        self._declare(enum)
        self._cursor.expect("{")
        enumerators: list[Constant] = []
        try:
            self._enumerator(enumerators)
            while self._cursor.accept(","):
                self._enumerator(enumerators)
            if self._cursor.token.text == "=":
                self._refuse(self._cursor.token)
        except IdlError as fault:
            self._diagnostics.error(fault.message, fault.source, fault.hint)
            while self._cursor.token.kind != "end" and self._cursor.token.text != "}":
                self._cursor.step()
        self._cursor.expect("}")
        for enumerator in enumerators:
            self._constants[*self._modules, enum.text, enumerator.name] = enumerator
        declared = _Declared(_ENUMERATOR, tuple(enumerators))
        self._types[*self._modules, enum.text] = declared
        return declared

    def _enumerator(self, before: list[Constant]) -> None:
        """Parse an enumerator, whose value is the successor of the one before, and add it to `before`."""
        given = self._annotations(_OF_ENUMERATORS).get("value")
        name = self._name()
        self._declare(name)
        value: Scalar = int(before[-1].value) + 1 if before else 0
        if given and given.value is not None:
            value = given.value
        value = self._fitted(value, _ENUMERATOR, given.token if given else name)
        before.append(Constant(name.text, _ENUMERATOR, value, str(value), self._text.place(name)))
        self._constants[*self._modules, name.text] = before[-1]

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
        value = self._fitted(self._expression.read(), kind, token)
        self._declare(name)
        self._constants[*self._modules, name.text] = Constant(name.text, kind, value, str(value), source)

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
            named = _Declared(self._sized(declared.type), declared.enumerators)
            # rosidl_adapter repeats the typedefs of a service's request for its response.
            if self._types.get((*self._modules, name.text)) != named:
                self._declare(name)
            self._types[*self._modules, name.text] = named
            if not self._cursor.accept(","):
                break

    # --- types

    def _type(self, depth: int = 0) -> _Declared:
        """Return the type that is next."""
        token = self._cursor.token
        if token.text in ("long", "unsigned", *PRIMITIVES):
            return _Declared(self._primitive())
        if token.text in ("string", "wstring"):
            self._cursor.step()
            bound = self._size(">", "<") if self._cursor.token.text == "<" else None
            return _Declared(StringType(token.text == "wstring", bound))
        if token.text == "sequence" and self._cursor.following.text == "<":
            return self._sequence(depth)
        self._refuse(token)
        is_absolute, words = self._cursor.scoped_name()
        declared = self._resolved(self._types, is_absolute, words)
        if declared:
            return declared
        modules = words[:-1] or tuple(self._modules)
        return _Declared(MessageType(_message_name(modules, words[-1], self._package)))

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

    def _sequence(self, depth: int) -> _Declared:
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
        return _Declared(SequenceType(self._element(declared.type, token), bound), declared.enumerators)

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

    def _declare(self, name: Token) -> None:
        """Note a name of the current module. Raise `IdlError` if it is known."""
        path = (*self._modules, name.text)
        if path in self._places:
            raise self._twice(name, self._places[path])
        self._places[path] = name

    def _twice(self, name: Token, first: Token) -> IdlError:
        line = self._text.place(first).line
        return self._text.fault(f"'{name.text}' is declared twice", name, f"the first declaration is in line {line}")

    def _resolved(self, known: dict[_Path, _T], is_absolute: bool, words: _Path) -> _T | None:
        """Return what a scoped name means: the declaration in the innermost module that has one."""
        scopes = [0] if is_absolute else range(len(self._modules), -1, -1)
        found = (known.get((*self._modules[:count], *words)) for count in scopes)
        return next((item for item in found if item is not None), None)

    def _value_of(self, is_absolute: bool, words: _Path) -> Scalar | None:
        constant = self._resolved(self._constants, is_absolute, words)
        constant = constant or self._resolved(self._constants, is_absolute, (self._own_constants, *words))
        return constant.value if constant else None

    def _annotations(self, effective: Collection[str] = ()) -> _Annotations:
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
        if given is None or given.value is None:
            return None
        if isinstance(kind, ArrayType | SequenceType):
            return self._default_elements(given, kind)
        if isinstance(kind, MessageType):
            hint = "only fields of primitive types can have default values"
            raise self._text.fault(f"a field of type {kind} cannot have a default value", given.token, hint)
        return self._fitted(given.value, kind, given.token)

    def _default_elements(self, given: _Annotation, kind: ArrayType | SequenceType) -> DefaultValue:
        """Return the elements in a text such as "(1, 2)", as rosidl writes the default of an array."""
        values: object = None
        if isinstance(given.value, str):
            try:
                values = ast.literal_eval(given.value.strip())
            except (ValueError, SyntaxError, MemoryError, RecursionError):
                values = None
        element = kind.element
        if not isinstance(values, tuple | list) or isinstance(element, MessageType):
            raise self._text.fault(
                f"'{given.value}' is not a value of {kind}", given.token, 'write an array as "(1, 2, 3)"'
            )
        most = kind.length if isinstance(kind, ArrayType) else kind.bound
        if most is not None and (len(values) > most or (isinstance(kind, ArrayType) and len(values) != most)):
            hint = f"legal here: {'exactly' if isinstance(kind, ArrayType) else 'at most'} {most} elements"
            raise self._text.fault(
                f"a default value with {len(values)} elements does not fit {kind}", given.token, hint
            )
        return tuple(self._fitted(value, element, given.token) for value in values)

    def _fitted(self, value: Scalar, kind: ElementType, token: Token) -> Scalar:
        """Return a value in the form of its type. Raise `IdlError` if the type has no such value."""
        assert self._ros.dialect is not None
        if isinstance(value, str) and isinstance(kind, PrimitiveType) and kind.is_character and len(value) == 1:
            value = ord(value)
        is_text = isinstance(value, str)
        try:
            if isinstance(kind, MessageType) or is_text != isinstance(kind, StringType):
                raise ValueError("")
            return scalar_of(str(value), kind, self._ros.dialect, has_quotes=False)
        except ValueError as fault:
            raise self._text.fault(f"'{value}' is not a value of {kind}", token, str(fault)) from None

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
