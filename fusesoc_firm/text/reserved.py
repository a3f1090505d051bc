"""Names that templates of VHDL declare or use, read from their text: generated names must differ from them."""

from __future__ import annotations

import re
from functools import cache

from fusesoc_firm.text.render import template_text

# Names that templates use but do not declare.
_USED = frozenset(
    """rtl firm ieee work std std_logic_1164 numeric_std std_logic std_logic_vector unsigned natural positive integer
    boolean line string to_unsigned to_integer resize shift_left shift_right rising_edge failure true false""".split()
)
_TAG = re.compile(r"\{\{\{?[^}]*\}?\}\}")
# Columns, and the tags of sections, which leave no text.
_MARK = re.compile(r"\{\{[|#^/][^}]*\}\}")
_PARTIAL = re.compile(r"\{\{> *([\w/]+)")
_COMMENT = re.compile(r"--.*")
_DECLARED = re.compile(
    r"^\s*(?:signal|constant|variable|type|subtype|function|alias)\s+"
    r"(\w+(?:\s*,\s*\w+)*)(?![\w\N{REPLACEMENT CHARACTER}])"  # signal a, b : ...
    r"|^\s*(\w+)\s*:"  # a port, a generic, the label of a process or an instance
    r"|\b(?:firm\.|use\s+firm\.\w+\.)(\w+)",  # a unit of the library
    re.MULTILINE,
)


def reserved_names(*templates: str) -> frozenset[str]:
    """Return the names that VHDL templates declare, and common names that they use without declaring them."""
    return _USED | declared_names(*templates)


@cache
def declared_names(*templates: str) -> frozenset[str]:
    """Return the names that VHDL templates and their partials declare, in lower case, except names with tags."""
    found: set[str] = set()
    for template in templates:
        text = template_text(template)
        found |= declared_names(*(f"partials/{name}" for name in _PARTIAL.findall(text)))
        text = _MARK.sub("", _COMMENT.sub("", text))
        text = _TAG.sub("\N{REPLACEMENT CHARACTER}", text)
        for names in _DECLARED.findall(text):
            found |= {name.strip().lower() for group in names for name in group.split(",") if name.strip()}
    return frozenset(found)
