"""Properties of an accelerator that are read from its sources."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.system.written.specification import Accelerator
from fusesoc_firm.text.files import is_file
from fusesoc_firm.text.naming import identifier


@dataclass(frozen=True)
class _Language:
    """A language's syntax for comments, a unit's parameters, and a parameter named WIDTH.

    `parameters` is a pattern with a placeholder for the unit's name and a group for the text between the name and the
    ports.
    """

    comment: re.Pattern[str]
    parameters: str
    width: re.Pattern[str]
    flags: re.RegexFlag


_LANGUAGES = {
    # Between `generic (` and `port (`; VHDL ignores case.
    "VHDL": _Language(
        re.compile(r"--.*"),
        r"\bentity\s+{unit}\s+is\s+generic\s*\((.*?)\)\s*;\s*(?:port\b|end\b)",
        re.compile(r"(?:^|[;,])\s*(?:constant\s+)?width\s*[:,]", re.IGNORECASE),
        re.IGNORECASE | re.DOTALL,
    ),
    # In the header or, as in Verilog before 2001, within the module.
    "Verilog": _Language(
        re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL),
        r"\bmodule\s+{unit}\b(.*?)\bendmodule\b",
        re.compile(r"\bparameter\b[^;]*?\bWIDTH\s*=(?!=)"),
        re.DOTALL,
    ),
}


def declares_width(accelerator: Accelerator, sources: Iterable[Path]) -> bool:
    """Return whether the accelerator is an entity with a generic WIDTH, or a module with a parameter WIDTH.

    WIDTH is the width of the streams in bits. Analysis, not this module, reports unreadable sources.
    """
    if (language := _LANGUAGES.get(accelerator.type)) is None:
        return False
    pattern = language.parameters.format(unit=re.escape(identifier(accelerator.name)))
    for source in sources:
        text = source.read_text(encoding="utf-8", errors="replace") if is_file(source) else ""
        if found := re.search(pattern, language.comment.sub("", text), language.flags):
            return bool(language.width.search(found[1]))
    return False
