"""Split IDL text into tokens with their places (OMG IDL 4.2, section 7.2).

Comments, `#include`, `#pragma` and include guards are left out: rosidl does not follow includes either, since a type's
full name already says which definition it means.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import NamedTuple

from fusesoc_firm.text.diagnostics import SourceRef

MOST_NESTED = 32
"""The limit of nested modules, sequences and parentheses, which are parsed by recursion."""
_BYTE_ORDER_MARK = "\ufeff"
_LINE_END = re.compile(r"\r\n?")
# `>>` is two tokens, since it also ends a sequence of sequences.
_TOKEN = re.compile(
    r"""(?P<blank>\s+|//[^\n]*|/\*(?s:.*?)\*/)
    |(?P<directive>\#[^\n]*)
    |(?P<string>L?"(?:[^"\\\n]|\\.)*+")
    |(?P<character>L?'(?:[^'\\\n]|\\.)(?:[^'\\\n])*+')
    |(?P<number>0[xX][0-9a-fA-F]+|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?[dD]?)
    |(?P<word>[A-Za-z_][A-Za-z0-9_]*)
    |(?P<mark>::|<<|/(?!\*)|[{}()\[\]<>;,=@:|^&+*%~-])""",
    re.VERBOSE,
)
_GUARD = re.compile(r"#\s*(?:include\s*(?:\"[^\"]+\"|<[^>]+>)|pragma\b.*|ifndef\s+\w+|define\s+\w+|endif\b.*)\s*")
_COMMENT = re.compile(r"//.*|/\*.*")
_UNFINISHED = {"/*": "the comment has no end '*/'", '"': "the string has no closing quote"}


class Token(NamedTuple):
    """A token: its kind (string, character, number, word, mark or end), its text, and where it starts in the file."""

    kind: str
    text: str
    start: int


class IdlError(Exception):
    """A fault in IDL text: a message, its place and a hint."""

    def __init__(self, message: str, source: SourceRef, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.source = source
        self.hint = hint


class IdlText:
    """IDL text with its tokens, the last of which has the kind `end`. Raise `IdlError` for text that has no tokens."""

    def __init__(self, text: str, file: str) -> None:
        self._text = _LINE_END.sub("\n", text.removeprefix(_BYTE_ORDER_MARK))
        self._file = file
        self._starts = [0, *(match.end() for match in re.finditer("\n", self._text))]
        self._lines = self._text.split("\n")
        self.tokens = self._split()

    def place(self, first: Token, last: Token | None = None) -> SourceRef:
        """Return the place of the tokens `first` to `last`, or of one token."""
        line = bisect_right(self._starts, first.start)
        start, text = self._starts[line - 1], self._lines[line - 1]
        end = last.start + len(last.text) if last else first.start + len(first.text)
        width = max(1, min(end - start, len(text)) - (first.start - start))
        return SourceRef(self._file, line, first.start - start + 1, text, width)

    def fault(self, message: str, token: Token, hint: str = "") -> IdlError:
        """Return the fault at a token."""
        return IdlError(message, self.place(token), hint)

    def _split(self) -> list[Token]:
        tokens, position = [], 0
        while match := _TOKEN.match(self._text, position):
            token = Token(match.lastgroup or "", match.group(), position)
            position = match.end()
            if token.kind == "directive":
                self._check_directive(token)
            elif token.kind != "blank":
                tokens.append(token)
        if position < len(self._text):
            raise self._fault_at(position)
        return [*tokens, Token("end", "", len(self._text))]

    def _check_directive(self, token: Token) -> None:
        if not _GUARD.fullmatch(_COMMENT.sub("", token.text)):
            hint = "legal here: #include, #pragma, and an include guard of #ifndef, #define and #endif"
            raise self.fault(f"'{token.text}' is not supported in .idl files", token, hint)

    def _fault_at(self, position: int) -> IdlError:
        found = next((mark for mark in _UNFINISHED if self._text.startswith(mark, position)), self._text[position])
        return self.fault(_UNFINISHED.get(found, f"unexpected character '{found}'"), Token("mark", found, position))


class Cursor:
    """A position in the tokens of IDL text."""

    def __init__(self, text: IdlText) -> None:
        self.text = text
        self._position = 0

    @property
    def token(self) -> Token:
        """The next token."""
        return self.text.tokens[self._position]

    @property
    def last(self) -> Token:
        """The token before the next one."""
        return self.text.tokens[self._position - 1]

    @property
    def following(self) -> Token:
        """The token after the next one."""
        return self.text.tokens[min(self._position + 1, len(self.text.tokens) - 1)]

    def step(self) -> Token:
        """Return the next token and go past it, except for the end."""
        token = self.token
        self._position += token.kind != "end"
        return token

    def accept(self, text: str) -> bool:
        """Go past the next token if it is this keyword or mark; return whether it was."""
        is_next = self.token.text == text and self.token.kind in ("word", "mark")
        self._position += is_next
        return is_next

    def expect(self, text: str) -> None:
        """Go past this keyword or mark. Raise `IdlError` if it is not next."""
        if not self.accept(text):
            found = f"'{self.token.text}'" if self.token.text else "the end of the file"
            raise self.text.fault(f"expected '{text}' before {found}", self.token)

    def scoped_name(self) -> tuple[bool, tuple[str, ...]]:
        """Return whether a name begins with `::`, and its words. Raise `IdlError` if no name is next."""
        is_absolute = self.accept("::")
        words = [self.word("a name")]
        while self.accept("::"):
            words.append(self.word("a name"))
        return is_absolute, tuple(words)

    def word(self, expected: str) -> str:
        """Return the next word. Raise `IdlError`, with what was expected, if it is not a word."""
        if self.token.kind != "word":
            found = f"'{self.token.text}'" if self.token.text else "the end of the file"
            raise self.text.fault(f"expected {expected} before {found}", self.token)
        return self.step().text
