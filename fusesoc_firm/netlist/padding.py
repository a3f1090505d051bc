"""Text that moves the places at which GHDL's tables grow.

GHDL 2.0 has a table of all assignments, in the order of synthesis, which begins with the top unit. If the table grows
while some bits of a signal are assigned, GHDL crashes (`translation._MEMORY`). Further assignments at the start of the
top unit's architecture let the table grow at another assignment.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_TOKEN = re.compile(r"""--[^\n]*|"[^"\n]*"|(?<!\w)'.'|[A-Za-z]\w*|[();:]""")
_BEGIN = "begin"


@dataclass(frozen=True)
class Padding:
    """A number of assignments in the architecture of `unit`; the unused signal results in no gates."""

    unit: str
    assignments: int

    @property
    def text(self) -> str:
        """The additional statement, on one line."""
        bits = " ".join(f"firm_padding({bit}) <= '0';" for bit in range(self.assignments))
        return (
            f" firm_pad : block signal firm_padding : bit_vector(0 to {self.assignments - 1}); begin {bits} end block;"
            if self.assignments
            else ""
        )

    def place(self, code: str) -> int | None:
        """Return the position in a file's code after the `begin` of the unit's architecture, or None without one."""
        body = re.compile(rf"\barchitecture\s+\w+\s+of\s+{re.escape(self.unit)}\s+is\b", re.IGNORECASE)
        found = body.search(code) if self.assignments else None
        return _after_begin(code, found.end()) if found else None


def _after_begin(code: str, start: int) -> int | None:
    """Return the position after the `begin` of the architecture whose declarations begin at `start`."""
    open_bodies = depth = 0
    is_in_signature = False
    before = ""
    for token in _TOKEN.finditer(code, start):
        word = token[0].lower()
        depth += (word == "(") - (word == ")")
        # `attribute a of f : function is` declares no function.
        if word in ("function", "procedure") and before != ":":
            is_in_signature = True
        elif is_in_signature and not depth and word in (";", "is"):
            is_in_signature = False
            open_bodies += word == "is"
        elif word == "new" and before == "is":
            open_bodies -= 1
        elif word == _BEGIN and not open_bodies:
            return token.end()
        elif word == _BEGIN:
            open_bodies -= 1
        before = word
    return None
