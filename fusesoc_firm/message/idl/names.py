"""The names of the messages, services and actions that IDL text declares."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from fusesoc_firm.message.idl.tokens import MOST_NESTED, IdlError, IdlText, Token
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.unsupported import IDL_FEATURES

SUFFIX = "idl"

Path = tuple[str, ...]
"""The names of modules, from the outermost one, and possibly of a declaration in them."""

# What includes of other files may need, and keywords of features that are not supported.
_OTHER_DECLARATIONS = frozenset({"enum", "typedef", "const"})
_UNSUPPORTED = frozenset(word for word in IDL_FEATURES if word.isalpha())
_KINDS = {kind.value: kind for kind in InterfaceKind}
_PARTS = {InterfaceKind.SERVICE: ("_Request", "_Response"), InterfaceKind.ACTION: ("_Goal", "_Result", "_Feedback")}


def declared_in(
    text: str, package: str, expected: tuple[InterfaceKind, MessageName]
) -> list[tuple[InterfaceKind, MessageName]]:
    """Return the messages, services and actions that IDL text declares; the text is not checked.

    `package` is the package of structs outside all modules. Without a struct, the result is the `expected` interface,
    on whose use the reason is reported; but it is empty if the text only declares types for other files.
    """
    try:
        tokens = IdlText(text, "").tokens
    except IdlError:
        return [expected]
    structs = dict.fromkeys(_structs(tokens))
    if not structs:
        words = {token.text for token in tokens}
        return [] if words & _OTHER_DECLARATIONS and not words & _UNSUPPORTED else [expected]
    return list(dict.fromkeys(_declared(modules, name, package, structs) for modules, name in structs))


def kind_of(modules: Path) -> InterfaceKind:
    """Return the kind of interface to which a struct in these modules belongs."""
    return _KINDS.get(modules[1], InterfaceKind.MESSAGE) if len(modules) > 1 else InterfaceKind.MESSAGE


def message_name(modules: Path, name: str, package: str) -> MessageName:
    """Return the name of the message that a struct defines; modules below those of ROS are a part of the name."""
    below = modules[2:] if len(modules) > 1 and modules[1] in _KINDS else modules[1:]
    return MessageName(modules[0] if modules else package, "_".join((*below, name)))


def constants_module(struct: str) -> str:
    """Return the name of the module with a struct's constants."""
    return f"{struct}_Constants"


def _structs(tokens: Sequence[Token]) -> Iterator[tuple[Path, str]]:
    """Yield the modules and the name of each struct with members, up to modules that are nested too deeply."""
    scopes: list[str | None] = []
    for word, name, mark in zip(tokens, tokens[1:], tokens[2:], strict=False):
        if len(scopes) > MOST_NESTED:
            return
        if word.text == "}" and scopes:
            scopes.pop()
        if word.text == "struct" and name.kind == "word" and mark.text in ("{", ":"):
            yield tuple(scope for scope in scopes if scope), name.text
        if mark.text == "{":
            scopes.append(name.text if word.text == "module" else None)


def _declared(
    modules: Path, name: str, package: str, structs: Collection[tuple[Path, str]]
) -> tuple[InterfaceKind, MessageName]:
    """Return the service or action of which a struct is a part, if all its parts are declared, or else the message."""
    kind = kind_of(modules)
    for part in _PARTS.get(kind, ()):
        base = name.removesuffix(part)
        if base != name and all((modules, f"{base}{other}") in structs for other in _PARTS[kind]):
            return kind, message_name(modules, base, package)
    return InterfaceKind.MESSAGE, message_name(modules, name, package)
