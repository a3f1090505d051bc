"""Names that a field's port must not have, since the templates declare or use them; read from the templates."""

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
_COMMENT = re.compile(r"--.*")
_DECLARED = re.compile(
    r"^\s*(?:signal|constant|variable|type|subtype|function|alias)\s+(\w+(?:\s*,\s*\w+)*)"  # signal a, b : ...
    r"|^\s*(\w+)\s*:"  # a port, a generic, the label of a process or an instance
    r"|\b(?:firm\.|use\s+firm\.\w+\.)(\w+)",  # a unit of the library
    re.MULTILINE,
)


@cache
def reserved_names(*templates: str) -> frozenset[str]:
    """Return the names in the VHDL templates in lower case, except names with tags, which expand to numbered names."""
    found = set(_USED)
    for template in templates:
        text = _TAG.sub("\N{REPLACEMENT CHARACTER}", _COMMENT.sub("", template_text(template)))
        for names in _DECLARED.findall(text):
            found |= {name.strip().lower() for group in names for name in group.split(",") if name.strip()}
    return frozenset(found)
