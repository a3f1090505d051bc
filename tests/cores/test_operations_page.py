"""docs/reference/operation-ports.md: the generics, operands and results of each operation, as its entity has them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "operation-ports.md"
OVERVIEW = ROOT / "docs" / "reference" / "arithmetic.md"
_GENERIC = re.compile(r"^ +(?P<name>[A-Z_]+) +: \w+ +:= (?P<default>\w+)", re.MULTILINE)
_PORT = re.compile(
    r"^ +(?P<name>(?:in|out)_\w+) +: (?:in |out) +(?P<type>\S.*?)(?: := (?P<default>'\d'))?;?$", re.MULTILINE
)
_HANDSHAKE = {"in_valid", "in_ready", "out_valid", "out_ready"}


def operations() -> list[str]:
    """The entities of the tables in arithmetic.md."""
    return re.findall(r"^\| `(firm_\w+)` \|", OVERVIEW.read_text(encoding="utf-8"), re.MULTILINE)


def ports(entity: str, direction: str) -> Iterator[str]:
    for port in _PORT.finditer(entity):
        if port["name"].startswith(direction) and port["name"] not in _HANDSHAKE:
            bits = re.sub(r"std_logic_vector\((.*) downto 0\)", r"\1", port["type"])
            width = (
                "" if bits == "std_logic" else f" ({bits.removesuffix('-1') if bits.endswith('-1') else bits + '+1'})"
            )
            default = f" = {port['default']}" if port["default"] else ""
            yield f"`{port['name']}`{width}{default}"


def row(name: str) -> str:
    (path,) = (ROOT / "cores" / "acc").rglob(f"{name}.vhd")
    entity = path.read_text(encoding="utf-8").partition(f"entity {name} is")[2].partition(f"end entity {name}")[0]
    generics = ", ".join(f"`{found['name']}` = {found['default']}" for found in _GENERIC.finditer(entity))
    return f"| `{name}` | {generics} | {', '.join(ports(entity, 'in_'))} | {', '.join(ports(entity, 'out_'))} |"


def test_every_operation_has_its_row() -> None:
    assert len(operations()) >= 17
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `firm_")]
    assert lines == [row(name) for name in operations()]
