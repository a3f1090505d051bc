"""Check the values of constants, enumerators and defaults against their types."""

from __future__ import annotations

import ast
import warnings

from fusesoc_firm.message.dialect import Dialect
from fusesoc_firm.message.idl.tokens import IdlText, Token
from fusesoc_firm.message.model import (
    ArrayType,
    DefaultValue,
    ElementType,
    FieldType,
    MessageType,
    PrimitiveType,
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.values import count_fault, scalar_of


class Values:
    """A converter of values to the form of their types; its methods raise `IdlError` for values that do not fit."""

    def __init__(self, text: IdlText, dialect: Dialect) -> None:
        self._text = text
        self._dialect = dialect

    def scalar(self, value: Scalar, kind: ElementType, token: Token) -> Scalar:
        """Return a value of a number, bool or string."""
        if isinstance(value, str) and isinstance(kind, PrimitiveType) and kind.is_character and len(value) == 1:
            value = ord(value)
        is_text = isinstance(value, str)
        try:
            if isinstance(kind, MessageType) or is_text != isinstance(kind, StringType):
                raise ValueError("")
            return scalar_of(str(value), kind, self._dialect, has_quotes=False)
        except ValueError as fault:
            raise self._text.fault(f"'{value}' is not a value of {kind}", token, str(fault)) from None

    def default(self, value: Scalar, kind: FieldType, token: Token) -> DefaultValue:
        """Return a default value; that of an array is a text such as "(1, 2)", as rosidl writes it."""
        if isinstance(kind, MessageType):
            hint = "only fields of primitive types can have default values"
            raise self._text.fault(f"a field of type {kind} cannot have a default value", token, hint)
        if not isinstance(kind, ArrayType | SequenceType):
            return self.scalar(value, kind, token)
        elements = _literal(value)
        if not isinstance(elements, tuple | list):
            raise self._text.fault(f"'{value}' is not a value of {kind}", token, 'write an array as "(1, 2, 3)"')
        if hint := count_fault(kind, len(elements)):
            message = f"a default value with {len(elements)} elements does not fit {kind}"
            raise self._text.fault(message, token, hint)
        return tuple(self.scalar(element, kind.element, token) for element in elements)


def _literal(value: Scalar) -> object:
    """Return the value of a text that is a literal of Python, or None."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return ast.literal_eval(value.strip()) if isinstance(value, str) else None
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return None
