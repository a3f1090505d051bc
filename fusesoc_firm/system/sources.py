"""What the sources of an accelerator tell about it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from fusesoc_firm.naming import identifier
from fusesoc_firm.system.specification import Accelerator

_COMMENT = re.compile(r"--.*")
# Between `generic (` and `port (`; VHDL knows no case.
_GENERICS = r"\bentity\s+{entity}\s+is\s+generic\s*\((.*?)\)\s*;\s*(?:port\b|end\b)"
_WIDTH = re.compile(r"(?:^|[;,])\s*(?:constant\s+)?width\s*[:,]", re.IGNORECASE)


def declares_width(accelerator: Accelerator, sources: Iterable[Path]) -> bool:
    """Whether the accelerator is an entity in VHDL with a generic WIDTH: the bits of its streams.

    A source that cannot be read is the analysis' concern, not this one's.
    """
    if accelerator.type != "VHDL":
        return False
    pattern = _GENERICS.format(entity=re.escape(identifier(accelerator.name)))
    for source in sources:
        text = _COMMENT.sub("", source.read_text(encoding="utf-8", errors="replace")) if source.is_file() else ""
        if found := re.search(pattern, text, re.IGNORECASE | re.DOTALL):
            return bool(_WIDTH.search(found[1]))
    return False
