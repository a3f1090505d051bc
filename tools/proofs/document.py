"""docs/figures/proofs.md: its tables hold what is proved, of which sizes, by what, and how long it took."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from tests.hdl.ghdl import REPOSITORY
from tools.proofs.all import PROOFS
from tools.proofs.proof import Proof, Size

DOCUMENT = REPOSITORY / "docs" / "figures" / "proofs.md"

_TABLES = re.compile(r"(?<=<!-- by make proofs -->\n).*?(?=<!-- end -->)", re.DOTALL)
_COLUMNS = ("harness", "of", "sizes", "method", "faults found", "seconds")
# Generics of sizes, as a table says them.
_SHORT = {
    "WIDTH": "W",
    "SUBSCRIBERS": "N",
    "REQUESTERS": "N",
    "SOURCES": "N",
    "FRAMES": "F",
    "MESSAGES": "F",
    "LIMIT": "L",
    "WATCHDOG": "L",
    "MAX_LENGTH": "M",
    "DEPTH": "D",
    "INDEX_BITS": "I",
    "LONGEST": "B",
    "SAMPLES": "S",
    "PORTS": "P",
}
# Those of messages that become frames.
_OF_MESSAGES = {"FIELD_BITS": "B", "COPIES": "C"}
# Generics whose bits are counted.
_COUNTED = {"TURNS": "T", "COPIES": "C"}
# Generics that a table says if they are true.
_CHOICES = {"DROP_OLDEST": "drop_oldest", "DROP_NEWEST": "drop_newest", "SHARED_READ": "shared_read"}


def tables() -> str:
    """What is between the marks now."""
    found = _TABLES.search(DOCUMENT.read_text(encoding="utf-8"))
    return found[0] if found else ""


def row(proof: Proof) -> str:
    """The row of a proof but for the seconds."""
    entity = proof.entity + (f", {proof.variant}" if proof.variant else "")
    faults = sum(len(mutation.violates) for mutation in proof.mutations)
    return _line((f"`{proof.harness}`", entity, _sizes(proof), proof.method, str(faults)))


def properties() -> Iterator[str]:
    """A row for each harness, with the labels of its properties."""
    for harness, labels in {proof.harness: proof.properties for proof in PROOFS}.items():
        yield _line((f"`{harness}`", ", ".join(f"`{label}`" for label in labels)))


def write(seconds: Mapping[str, float]) -> None:
    """Write the tables anew, with the seconds by the names of the proofs."""
    lines = [
        *_head("harness", "properties"),
        *properties(),
        "",
        *_head(*_COLUMNS),
        *(f"{row(proof)} {seconds[proof.name]:.0f} |" for proof in PROOFS),
    ]
    text = DOCUMENT.read_text(encoding="utf-8")
    DOCUMENT.write_text(_TABLES.sub(lambda _: "\n" + "\n".join(lines) + "\n\n", text), encoding="utf-8")


def _sizes(proof: Proof) -> str:
    return "; ".join(" ".join(_words(size)) for size in (*proof.sizes, *proof.long_sizes))


def _words(size: Size) -> Iterator[str]:
    # A tree has no subscribers in its proof.
    short = _SHORT if "SUBSCRIBERS" in size else {**_SHORT, "PUBLISHERS": "N"}
    if "WIDTH" in size:
        short = {**short, **_OF_MESSAGES}
    for name, value in size.items():
        if name in short:
            yield f"{short[name]}={value}"
        elif name in _COUNTED and value:
            yield f"{_COUNTED[name]}={int(value).bit_count()}"
        elif value and name in _CHOICES:
            yield _CHOICES[name]


def _head(*names: str) -> list[str]:
    return [_line(names), "|" + "---|" * len(names)]


def _line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"
