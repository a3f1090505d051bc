"""Features of other definition languages that `.msg` lacks, each with a name and the equivalent in `.msg`.

docs/explanation/frames.md describes how a Frame could represent each feature. None of the features is legal in ROS 1 or
ROS 2: both reference parsers reject every form, and a word is looked up only if no message has, or can have, that name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from fusesoc_firm.message.piece import Piece


@dataclass(frozen=True)
class Feature:
    """A feature, its usual form at the start of a line, and its keywords."""

    name: str
    form: re.Pattern[str]
    words: frozenset[str]
    hint: str

    @property
    def fault(self) -> str:
        """The message for the user."""
        return f"{self.name} are not supported in .msg files"


def _feature(name: str, words: str, forms: tuple[str, ...], hint: str) -> Feature:
    return Feature(name, re.compile("|".join(f"(?:{form})" for form in forms)), frozenset(words.split()), hint)


# A keyword followed by two words or a block; a keyword followed by one word is a field's type.
_DECLARATION = r"{}(?=\s+\S+\s+\S|\s*\{{|\s+\w+\s*\{{)"

FEATURES = (
    _feature(
        "multi-dimensional arrays",
        "",
        (r"[^\s\[\]=]+\[[^\[\]]*\]\s*\[[^\[\]]*\]", r"[^\s\[\]=]+\[\s*[1-9]\d*\s*[,x*]\s*\d+[^\]]*\]"),
        "use one dimension, such as 'float64[9] x' for 3 by 3 elements; element (i, j) is x[3*i + j]",
    ),
    _feature(
        "maps",
        "map dict",
        (r"(?:std::)?(?:unordered_map|map|dict)\s*<[^>]*>?",),
        "use an array of a message with the fields 'key' and 'value'",
    ),
    _feature(
        "optional fields",
        "optional",
        (r"@optional\b", r"(?:std::)?optional\s*<[^>]*>?", _DECLARATION.format("optional"), r"\w+(?:/\w+)*\?(?=\s)"),
        "use an array of at most one element, or add a bool field",
    ),
    _feature(
        "unions",
        "union variant oneof",
        (r"(?:std::)?variant\s*<[^>]*>?", _DECLARATION.format("(?:union|oneof)")),
        "use a number for the variant, and a field for each variant",
    ),
    _feature(
        "typedefs",
        "typedef",
        (_DECLARATION.format("typedef"), r"using\s+\w+\s*=.*"),
        "use the type itself, or a message with a field of this type",
    ),
    _feature(
        "'any' types",
        "any",
        (r"(?:std::)?any\s*<[^>]*>?",),
        "use the fields 'string type' and 'uint8[] data'",
    ),
    _feature(
        "inherited fields",
        "extends inherits",
        (r"(?:extends|inherits)(?=\s+\w+/\w)",),
        "use a field for the base message, such as 'Base base'",
    ),
    _feature(
        "enum types",
        "enum",
        (_DECLARATION.format("enum"),),
        "use a number and constants, such as 'uint8 mode' and 'uint8 MODE_IDLE=0'",
    ),
)


def unsupported_form(code: Piece) -> tuple[Feature, Piece] | None:
    """Return the unsupported feature in a line (without its comment), and the part of the line that uses it."""
    for feature in FEATURES:
        if match := feature.form.match(code.text):
            return feature, code.part(0, match.end())
    return None


def unsupported_word(type_name: str) -> Feature | None:
    """Return the unsupported feature that this type name suggests, or None."""
    return next((feature for feature in FEATURES if type_name.lower() in feature.words), None)


@dataclass(frozen=True)
class IdlFeature:
    """A feature of IDL that messages lack: its name, and what to use in its place."""

    name: str
    hint: str


# By the keyword or mark that begins the feature.
IDL_FEATURES = {
    "[": IdlFeature("arrays of arrays", "use one dimension, such as 'double x[9]' for 3 by 3, or a struct"),
    ":": IdlFeature("inherited fields", "use a field for the base struct, such as 'Base base'"),
    "@optional": IdlFeature(
        "optional fields", "ROS 2 sends every field; use a sequence of at most one element, or add a boolean field"
    ),
    "@annotation": IdlFeature("definitions of annotations", "annotations other than '@default' are ignored"),
    "=": IdlFeature("values of enumerators after '='", "write '@value(1) NAME'"),
    "union": IdlFeature("unions", "use a number for the variant, and a field for each variant"),
    "map": IdlFeature("maps", "use a sequence of a struct with the fields 'key' and 'value'"),
    "any": IdlFeature("'any' types", "use the fields 'string type' and 'sequence<uint8> data'"),
    "fixed": IdlFeature("fixed-point numbers", "use a 'long long' in units of the last digit, or a 'double'"),
    "long double": IdlFeature("numbers of 128 bits", "use 'double'; the type descriptions of ROS 2 lack 'long double'"),
    "wchar": IdlFeature("wide characters", "use 'wstring<1>'; middlewares differ in the size of a 'wchar'"),
    "bitmask": IdlFeature("bitmasks", "use an unsigned number and constants"),
    "bitset": IdlFeature("bitsets", "use an unsigned number and constants, or one field for each part"),
    "interface": IdlFeature("interfaces", "define a service with the structs 'NAME_Request' and 'NAME_Response'"),
    "valuetype": IdlFeature("value types", "use a struct"),
    "native": IdlFeature("native types", "use a struct"),
    "exception": IdlFeature("exceptions", "use a struct"),
}
