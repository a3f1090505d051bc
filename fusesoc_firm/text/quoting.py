"""Quote users' text for the language of the generated file.

Names, descriptions, file names and constants of messages may contain any printable character. A template specifies the
kind of each text, `{{comment block}}` or `{{string topic}}`; the template's ending determines the language.
"""

from __future__ import annotations

import html
import re
import shlex
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

import yaml

Quote = Callable[[str], str]

# Characters without special meaning to Tcl, Make or a shell, anywhere in a word.
_PLAIN_WORD = re.compile(r"[A-Za-z0-9_./:+,-]+")
_PRINTABLE_ASCII = range(0x20, 0x7F)
_C_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n"}
_SECOND_QUESTION_MARK = re.compile(r"(?<=[?])[?]")


def comment(text: str) -> str:
    """Return `text` as printable ASCII for a single-line comment in any language.

    VHDL-93 is Latin-1, and GHDL rejects UTF-8 even in comments. A backslash at the end of a line, which C also spells
    `??/`, would extend the comment to the next line.
    """
    escaped = text.encode("unicode_escape").decode("ascii").replace("??/", "? ?/")
    return f"{escaped}." if escaped.endswith("\\") else escaped


def lines_of(text: str) -> list[str]:
    """Split a text into lines with their newlines; unlike in `splitlines`, only a newline ends a line."""
    return [f"{line}\n" for line in text.removesuffix("\n").split("\n")]


def c_string(text: str) -> str:
    """Return a C and C++ string literal in UTF-8; escapes are octal, since hexadecimal escapes have no fixed length."""
    letters = "".join(map(_c_byte, text.encode("utf-8", "surrogateescape")))
    # The second of two question marks could begin a trigraph.
    escaped = _SECOND_QUESTION_MARK.sub(r"\\?", letters)
    return f'"{escaped}"'


def _c_byte(byte: int) -> str:
    if chr(byte) in _C_ESCAPES:
        return _C_ESCAPES[chr(byte)]
    return chr(byte) if byte in _PRINTABLE_ASCII else f"\\{byte:03o}"


def python_string(text: str) -> str:
    """Return a Python string literal, in double quotes unless more than a trailing newline needs an escape."""
    body = text.removesuffix("\n")
    if not body.isprintable() or {'"', "\\"} & {*body}:
        return repr(text)
    return f'"{body}\\n"' if body != text else f'"{body}"'


def tcl_word(text: str) -> str:
    """Return a Tcl word that evaluates to `text` without substitutions, and that keeps surrounding braces balanced."""
    if _PLAIN_WORD.fullmatch(text):
        return text
    return f'"{"".join(map(_tcl_character, text))}"'


def _tcl_character(character: str) -> str:
    if character in '\\"$[]{};#':
        return f"\\{character}"
    if ord(character) in _PRINTABLE_ASCII:
        return character
    units = character.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[first : first + 4]}" for first in range(0, len(units), 4))


def yaml_scalar(text: str) -> str:
    """Return a single-line YAML scalar that reads back as the string `text`, never as a number or a list."""
    return _yaml(text, text).removesuffix("\n...")


def yaml_list(texts: Iterable[str]) -> str:
    """Return a YAML list of strings on one line."""
    words = [*texts]
    return _yaml(words, "".join(words))


def _yaml(value: str | list[str], text: str) -> str:
    # PyYAML folds newlines. Without full escaping, PyYAML also writes a NEL unescaped but reads it as a blank.
    is_plain = text.isprintable()
    style = None if is_plain else '"'
    shown = yaml.safe_dump(value, default_style=style, default_flow_style=True, allow_unicode=is_plain, width=10**6)
    return shown.removesuffix("\n")


def dot_text(text: str) -> str:
    """Return `text` escaped for a quoted string in Graphviz's language."""
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def dot_markup(text: str) -> str:
    """Return `text` escaped for a label in Graphviz's markup, where a backslash also begins an escape sequence.

    Graphviz rejects a single bracket, but accepts its character code.
    """
    return html.escape(text).replace("\\", "\\\\").replace("]", "&#93;")


def plot_text(text: str) -> str:
    """Return `text` for matplotlib, with dollars escaped so that they do not begin formulas."""
    return text.replace("\\", "\\\\").replace("$", "\\$")


def make_prerequisite(name: str) -> str:
    """Return a file's name, escaped as a prerequisite in a makefile."""
    return re.sub("[ #:]", r"\\\g<0>", name).replace("$", "$$")


def make_argument(text: str) -> str:
    """Return an argument of a command in a makefile's recipe, escaped for Make and then for a shell."""
    return shlex.quote(text).replace("$", "$$")


_HDL = {"comment": comment}
_TCL = {"comment": comment, "word": tcl_word}
_MARKUP = {"text": html.escape}
# The quoting functions of each language, by the ending of the template.
QUOTES: Mapping[str, Mapping[str, Quote]] = MappingProxyType(
    {
        "vhd": _HDL,
        "v": _HDL,
        "lpf": _HDL,
        "ccf": _HDL,
        "pcf": _HDL,
        "pdc": _HDL,
        "cst": _HDL,
        "tcl": _TCL,
        "xdc": _TCL,
        "sdc": _TCL,
        "cpp": {"comment": comment, "string": c_string},
        "py": {"comment": comment, "string": python_string},
        "core": {"scalar": yaml_scalar},
        "yaml": {"scalar": yaml_scalar},
        "conf": {},
        "dot": {"text": dot_text},
        "html": _MARKUP,
        "xml": _MARKUP,
    }
)
