"""The parameters and interface pragmas of a C++ function for HLS.

Only the function's declaration is read. Where macros or other syntax could change its meaning, the function is unknown:
the compiler of the simulation reports errors in it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from fusesoc_firm.accelerator.unit import place
from fusesoc_firm.text.diagnostics import SourceRef

_TOKEN = re.compile(
    r"""(?P<blank>\s+|//[^\n]*|/\*.*?\*/)
    |(?P<directive>\#(?:\\\n|[^\n])*)
    |(?P<word>[A-Za-z_]\w*(?:::\w+)*)
    |(?P<other>"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|\d[\w.']*|.)""",
    re.DOTALL | re.VERBOSE,
)
_INTERFACE = re.compile(r"#\s*pragma\s+HLS\s+INTERFACE\b", re.IGNORECASE)
_PORT = re.compile(r"\bport\s*=\s*(\w+)", re.IGNORECASE)
# `INTERFACE mode=ap_none`, or `INTERFACE ap_none` in older versions.
_MODE = re.compile(r"\bmode\s*=\s*(\w+)|\bINTERFACE\s+(\w+)\b(?!\s*=)", re.IGNORECASE)
_INCLUDE = re.compile(r"#\s*include\b")
_WORD = re.compile(r"\w+")
_DEFINE = re.compile(r"#\s*define\s+(\w+)")
_OPENING, _CLOSING = ("(", "[", "{", "<"), (")", "]", "}", ">")
_QUALIFIERS = ("const", "volatile")
# Words that end a declaration without a name.
_TYPE_WORDS = ("bool", "char", "double", "float", "int", "long", "short", "signed", "unsigned", *_QUALIFIERS)
_SAME_TYPES = {
    "signed char": "int8_t",
    "unsigned char": "uint8_t",
    "short": "int16_t",
    "unsigned short": "uint16_t",
    "int": "int32_t",
    "unsigned": "uint32_t",
    "unsigned int": "uint32_t",
    "long long": "int64_t",
    "unsigned long long": "uint64_t",
}


@dataclass(frozen=True)
class CppParameter:
    """A parameter with its declaration in the source; `size` is the text of an array's size.

    `type` is the type of a value, an array's elements or a stream's elements, without `std::` and qualifiers.
    """

    name: str
    place: SourceRef
    declaration: str
    type: str
    is_stream: bool
    is_indirect: bool
    size: str | None


@dataclass(frozen=True)
class InterfacePragma:
    """A pragma that names the mode of a port; the mode may be empty."""

    port: str
    place: SourceRef
    mode: str


@dataclass(frozen=True)
class CppFunction:
    """A function with a body. `words` are all words that the body may contain, or None if it includes a file."""

    name: str
    place: SourceRef
    parameters: tuple[CppParameter, ...]
    pragmas: tuple[InterfacePragma, ...]
    words: frozenset[str] | None


class _Token(NamedTuple):
    text: str
    start: int
    kind: str


def read_function(path: Path, name: str) -> CppFunction | None:
    """Return the function `name` of a file, or None unless it is defined exactly once in a known form."""
    return _File(path).function(name)


def lacks_function(path: Path, name: str) -> bool:
    """Return whether a file certainly defines no function `name`: it names none, and includes no file of its own."""
    return _File(path).lacks(name)


class _File:
    """The tokens of a C++ file, without blanks and comments."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._text = path.read_text(encoding="utf-8", errors="replace")
        self._lines = self._text.split("\n")
        found = (_Token(match[0], match.start(), match.lastgroup or "") for match in _TOKEN.finditer(self._text))
        self._tokens = [token for token in found if token.kind != "blank"]
        directives = (token.text for token in self._tokens if token.kind == "directive")
        # The name of each macro, with its text.
        self._macros = {match[1]: text for text in directives if (match := _DEFINE.match(text))}

    def function(self, name: str) -> CppFunction | None:
        definitions = list(self._definitions(name))
        if len(definitions) != 1:
            return None
        start, end = definitions[0]
        parameters = [self._parameter(tokens) for tokens in _split(self._tokens[start + 2 : end])]
        known = tuple(item for item in parameters if item)
        if len(known) != len(parameters):
            return None
        body = self._tokens[end + 1 : self._closing(end + 1)]
        pragmas = tuple(pragma for token in body if (pragma := self._pragma(token)))
        place = self._place(self._tokens[start].start, len(name))
        return CppFunction(name, place, known, pragmas, self._words(body))

    def lacks(self, name: str) -> bool:
        """Return whether no word is `name`; a macro or an included file could make one of other words."""
        directives = [token.text for token in self._tokens if token.kind == "directive"]
        if any("##" in text or re.match(r'#\s*include\s*"', text) or name in text for text in directives):
            return False
        return all(token.text != name for token in self._tokens)

    def _definitions(self, name: str) -> Iterator[tuple[int, int]]:
        """Yield the indices of the function's name and of the parenthesis that closes its parameters."""
        for index, token in enumerate(self._tokens[:-1]):
            if token.text == name and self._tokens[index + 1].text == "(":
                end = self._closing(index + 1)
                if [item.text for item in self._tokens[end + 1 : end + 2]] == ["{"]:
                    yield index, end

    def _closing(self, start: int) -> int:
        """Return the index of the token that closes the parenthesis or brace at `start`, or the end of the file."""
        opening = self._tokens[start].text
        closing = _CLOSING[_OPENING.index(opening)]
        depth = 0
        for index in range(start, len(self._tokens)):
            depth += {opening: 1, closing: -1}.get(self._tokens[index].text, 0)
            if not depth:
                return index
        return len(self._tokens)

    def _words(self, body: Sequence[_Token]) -> frozenset[str] | None:
        """Return the words of a body and of all macros, or None if a part of the body is in another file."""
        if any(_INCLUDE.match(token.text) for token in body if token.kind == "directive"):
            return None
        in_macros = (word for text in self._macros.values() for word in _WORD.findall(text))
        return frozenset([*(token.text for token in body if token.kind == "word"), *in_macros])

    def _parameter(self, tokens: Sequence[_Token]) -> CppParameter | None:
        """Return a parameter, or None if it has a macro, a default value or other unknown syntax."""
        texts = [token.text for token in tokens]
        end = texts.index("[") if "[" in texts else len(texts)
        size = "".join(texts[end + 1 : -1])
        is_known = end > 1 and not any(item in ("(", "=", *self._macros) or item[0] == "#" for item in texts[:end])
        if not is_known or "[" in size or (end < len(texts) and texts[-1] != "]"):
            return None
        name = tokens[end - 1]
        if name.kind != "word" or "::" in name.text or name.text in _TYPE_WORDS:
            return None
        declaration = self._text[tokens[0].start : tokens[-1].start + len(texts[-1])]
        type_, is_stream = _type_of(texts[: end - 1])
        return CppParameter(
            name.text,
            self._place(name.start, len(name.text)),
            " ".join(declaration.split()),
            type_,
            is_stream,
            is_indirect="*" in texts or "&" in texts,
            size=size if end < len(texts) else None,
        )

    def _pragma(self, token: _Token) -> InterfacePragma | None:
        port, mode = _PORT.search(token.text), _MODE.search(token.text)
        if not _INTERFACE.match(token.text) or not port:
            return None
        source = self._place(token.start + port.start(1), len(port[1]))
        return InterfacePragma(port[1], source, (mode[1] or mode[2]).lower() if mode else "")

    def _place(self, start: int, width: int) -> SourceRef:
        before = self._text[:start]
        return place(self._path, before.count("\n") + 1, start - before.rfind("\n"), width, self._lines)


def _split(tokens: Sequence[_Token]) -> list[list[_Token]]:
    """Return the parts of a list that commas separate."""
    parts: list[list[_Token]] = [[]]
    depth = 0
    for token in tokens:
        depth += (token.text in _OPENING) - (token.text in _CLOSING)
        if token.text == "," and not depth:
            parts.append([])
        else:
            parts[-1].append(token)
    return parts


def _type_of(texts: Sequence[str]) -> tuple[str, bool]:
    """Return the type of a value or of a stream's elements, and whether it is a stream; an unknown type is empty."""
    words = [text for text in texts if text not in (*_QUALIFIERS, "*", "&")]
    is_stream = words[:1] in (["hls::stream"], ["stream"])
    if is_stream:
        words = words[2:-1]
    elif "<" in words:
        return "", False
    name = " ".join(words).removeprefix("std::")
    return _SAME_TYPES.get(name, name), is_stream
