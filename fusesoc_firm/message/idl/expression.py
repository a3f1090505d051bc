"""Evaluate the constant expressions of IDL (OMG IDL 4.2, section 7.4.1.4.3).

expression = operand { operator operand }       `|` `^` `&` `<<` `>>` `+` `-` `*` `/` `%`, in rising precedence
operand    = { "-" | "+" | "~" } ( literal | name | "(" expression ")" )
"""

from __future__ import annotations

import operator
import re
import unicodedata
from collections.abc import Callable
from typing import Any

from fusesoc_firm.message.idl.tokens import MOST_NESTED, Cursor, Token
from fusesoc_firm.message.model import Scalar

# Results of larger magnitude fit into no type; the bound also limits the time of an evaluation.
_MOST_BITS = 64
_BOOLEANS = {"TRUE": True, "FALSE": False}
_PRECEDENCE = {"|": 1, "^": 2, "&": 3, "<<": 4, ">>": 4, "+": 5, "-": 5, "*": 6, "/": 6, "%": 6}


def _quotient(left: float, right: float) -> int | float:
    """Return the quotient; that of integers is rounded to zero, as in C."""
    if isinstance(left, float) or isinstance(right, float):
        return left / right
    quotient = abs(left) // abs(right)
    return quotient if (left < 0) == (right < 0) else -quotient


_OPERATIONS: dict[str, Callable[[Any, Any], int | float]] = {
    "|": operator.or_,
    "^": operator.xor,
    "&": operator.and_,
    "<<": operator.lshift,
    ">>": operator.rshift,
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _quotient,
    "%": lambda left, right: left - right * _quotient(operator.index(left), operator.index(right)),
}
_SIGNS: dict[str, Callable[[Any], int | float]] = {"-": operator.neg, "+": operator.pos, "~": operator.inv}
_NO_CHARACTERS = "legal here: all but the character zero and halves of surrogate pairs"
_ESCAPE = re.compile(r"\\(?:([0-7]{1,3})|x([0-9a-fA-F]{1,2})|u([0-9a-fA-F]{1,4})|(.))")
_ESCAPED = {"n": "\n", "t": "\t", "v": "\v", "b": "\b", "r": "\r", "f": "\f", "a": "\a"}


class Expression:
    """A reader of constant expressions; `value_of` returns the value of the constant with a scoped name, or None."""

    def __init__(self, cursor: Cursor, value_of: Callable[[bool, tuple[str, ...]], Scalar | None]) -> None:
        self._cursor = cursor
        self._value_of = value_of

    def read(self, is_in_brackets: bool = False) -> Scalar:
        """Return the value of the expression that is next; in angle brackets, `>` ends it. May raise `IdlError`."""
        return self._binary(1, 0, is_in_brackets)

    def _binary(self, lowest: int, depth: int, is_in_brackets: bool) -> Scalar:
        left = self._unary(depth, is_in_brackets)
        while _PRECEDENCE.get(found := self._operator(is_in_brackets), 0) >= lowest:
            token = self._cursor.step()
            if found == ">>":
                self._cursor.step()
            right = self._binary(_PRECEDENCE[found] + 1, depth, is_in_brackets)
            left = self._bounded(self._applied(found, token, left, right), token)
        return left

    def _operator(self, is_in_brackets: bool) -> str:
        """Return the text of the operator that is next, or of another token."""
        token, following = self._cursor.token, self._cursor.following
        if token.text == ">" and following.text == ">" and following.start == token.start + 1:
            return "" if is_in_brackets else ">>"
        return token.text if token.kind == "mark" else ""

    def _applied(self, name: str, token: Token, left: Scalar, right: Scalar) -> Scalar:
        fault = self._cursor.text.fault
        if not (_is_number(left) and _is_number(right)):
            raise fault(f"'{name}' takes numbers, not '{left}' and '{right}'", token)
        if name == "<<" and right not in range(_MOST_BITS):
            raise fault(f"cannot shift by {right}", token, f"legal here: 0 to {_MOST_BITS - 1}")
        try:
            return _OPERATIONS[name](left, right)
        except TypeError:
            raise fault(f"'{name}' takes whole numbers, not '{left}' and '{right}'", token) from None
        except (ValueError, ArithmeticError) as error:
            raise fault(f"{left} {name} {right} has no value: {error}", token) from None

    def _bounded(self, value: Scalar, token: Token) -> Scalar:
        if isinstance(value, int) and value.bit_length() > _MOST_BITS:
            raise self._cursor.text.fault("the result is too large", token, f"legal here: numbers of {_MOST_BITS} bits")
        return value

    def _unary(self, depth: int, is_in_brackets: bool) -> Scalar:
        signs = []
        while self._cursor.token.text in _SIGNS:
            signs.append(self._cursor.step())
        value = self._primary(depth, is_in_brackets)
        for sign in reversed(signs):
            if not _is_number(value) or (sign.text == "~" and isinstance(value, float)):
                raise self._cursor.text.fault(f"'{sign.text}' takes a number, not '{value}'", sign)
            value = _SIGNS[sign.text](value)
        return value

    def _primary(self, depth: int, is_in_brackets: bool) -> Scalar:
        token, text = self._cursor.token, self._cursor.text
        if token.kind == "word" and token.text in _BOOLEANS:
            return _BOOLEANS[self._cursor.step().text]
        match token.kind:
            case "string":
                return self._joined_strings()
            case "character":
                return self._character()
            case "number":
                return self._number()
            case "word":
                return self._constant()
        if self._cursor.accept("("):
            if depth == MOST_NESTED:
                raise text.fault(
                    "the parentheses are nested too deeply", token, f"legal here: up to {MOST_NESTED} levels"
                )
            value = self._binary(1, depth + 1, False)
            self._cursor.expect(")")
            return value
        if token.text == "::":
            return self._constant()
        found = f"'{token.text}'" if token.text else "the end of the file"
        raise text.fault(f"expected a value before {found}", token)

    def _constant(self) -> Scalar:
        token = self._cursor.token
        is_absolute, words = self._cursor.scoped_name()
        value = self._value_of(is_absolute, words)
        if value is None:
            hint = "a constant or enumerator must be declared before its use, in the same file"
            if words[0].upper() in _BOOLEANS:
                hint = f"legal here: {' and '.join(_BOOLEANS)}"
            raise self._cursor.text.fault(f"unknown constant '{'::'.join(words)}'", token, hint)
        return value

    def _joined_strings(self) -> str:
        """Return the text of adjacent strings."""
        parts, first = [], self._cursor.token
        while self._cursor.token.kind == "string":
            parts.append(_unescaped(self._cursor.step().text.removeprefix("L")[1:-1]))
        value = "".join(parts)
        if any(character == "\0" or unicodedata.category(character) == "Cs" for character in value):
            raise self._cursor.text.fault("a string has a character that no encoding has", first, _NO_CHARACTERS)
        return value

    def _character(self) -> str:
        token = self._cursor.step()
        text = _unescaped(token.text.removeprefix("L")[1:-1])
        if len(text) != 1:
            raise self._cursor.text.fault(f"{token.text} is not one character", token)
        return text

    def _number(self) -> int | float:
        token = self._cursor.step()
        text = token.text.lower()
        is_whole = text.startswith("0x") or text.isdigit()
        if not is_whole:
            return float(text.rstrip("d"))
        digits = text.removeprefix("0x").lstrip("0")
        if len(digits) > _MOST_BITS:
            raise self._cursor.text.fault("the number is too large", token, f"legal here: numbers of {_MOST_BITS} bits")
        try:
            return int(text, 16 if "x" in text else 8 if len(text) > 1 and text.startswith("0") else 10)
        except ValueError:
            hint = "a number that starts with 0 is octal, and has the digits 0 to 7"
            raise self._cursor.text.fault(f"'{token.text}' is not a number", token, hint) from None


def _is_number(value: Scalar) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _unescaped(text: str) -> str:
    return _ESCAPE.sub(_character_of, text)


def _character_of(match: re.Match[str]) -> str:
    octal, hexadecimal, unicode_, other = match.groups()
    if other:
        return _ESCAPED.get(other, other)
    return chr(int(octal, 8) if octal else int(hexadecimal or unicode_, 16))
