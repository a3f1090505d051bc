"""SystemRDL -> registers as plain data, for the VHDL template and for software that accesses the registers.

`systemrdl-compiler` reads the description, so its rules apply; overlapping fields are an error, for example.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path

from systemrdl.compiler import RDLCompiler
from systemrdl.node import AddrmapNode, FieldNode, RegfileNode, RegNode

from fusesoc_firm.converter.vhdl import index_bits
from fusesoc_firm.text.render import Context


class Kind(Enum):
    """The hardware of a field."""

    CONSTANT = "constant"
    STORAGE = "storage"
    STICKY = "sticky"  # hardware sets it, writing 1 clears it
    COUNTER = "counter"  # saturates at its highest value
    VALUE = "value"  # hardware drives it


@dataclass(frozen=True)
class Field:
    """A field of a register: `width` bits from bit `low`; `enable` is the path of an interrupt's enable field.

    Without `has_reset`, the description does not say what the field is after reset, and `reset` is 0.
    """

    name: str
    low: int
    width: int
    reset: int
    kind: Kind
    is_writable: bool
    enable: str = ""
    has_reset: bool = True

    def of(self, word: int) -> int:
        """Return the field's value in a register's word."""
        return word >> self.low & (1 << self.width) - 1


@dataclass(frozen=True)
class Register:
    """A register; `is_external` means that it is implemented outside the register block."""

    name: str
    address: int
    title: str
    fields: tuple[Field, ...]
    is_external: bool

    @property
    def is_constant(self) -> bool:
        """Whether the register never changes."""
        return all(field.kind is Kind.CONSTANT for field in self.fields)


@dataclass(frozen=True)
class RegisterMap:
    """All registers of a description, by address."""

    name: str
    registers: tuple[Register, ...]

    @cached_property
    def by_name(self) -> dict[str, Register]:
        """The registers by name, such as `shape` or `subscriber[1].frames`."""
        return {register.name: register for register in self.registers}


def compiled(path: Path) -> AddrmapNode:
    """Return the compiled description in a file, which must exist as long as the result is in use."""
    compiler = RDLCompiler()
    compiler.compile_file(str(path))
    return compiler.elaborate().top


def register_map(text: str) -> RegisterMap:
    """Return the registers of a description."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "registers.rdl"
        path.write_text(text, encoding="utf-8")
        top = compiled(path)
        return RegisterMap(top.inst_name, tuple(_registers(top)))


def _registers(top: AddrmapNode) -> Iterator[Register]:
    for node in top.descendants(unroll=True):
        if isinstance(node, RegNode):
            name = node.get_path(hier_separator=".").removeprefix(f"{top.inst_name}.")
            fields = tuple(_field(field, top) for field in node.fields())
            is_external = isinstance(node.parent, RegfileNode) and node.parent.external
            yield Register(name, node.absolute_address, str(node.get_property("name")), fields, is_external)


def _field(node: FieldNode, top: AddrmapNode) -> Field:
    enable = node.get_property("enable")
    path = enable.get_path(hier_separator="_").removeprefix(f"{top.inst_name}_") if enable else ""
    reset = node.get_property("reset")
    return Field(
        node.inst_name,
        node.low,
        node.width,
        reset if isinstance(reset, int) else 0,
        _kind(node),
        node.is_sw_writable,
        path,
        reset is not None,
    )


def _kind(node: FieldNode) -> Kind:
    if node.get_property("counter"):
        return Kind.COUNTER
    if node.get_property("hwset"):
        return Kind.STICKY
    if node.is_hw_writable:
        return Kind.VALUE
    return Kind.STORAGE if node.is_sw_writable else Kind.CONSTANT


def registers_configuration(registers: RegisterMap, signatures: Sequence[str], address_bits: int = 16) -> Context:
    """Return the configuration of the register block; `signatures` are the channels', in hexadecimal digits.

    External registers are not part of the block. With addresses of more than 16 bits, a memory holds the signatures.
    """
    has_signature_memory = address_bits > 16
    signature_bits = index_bits(len(signatures))
    words = [*signatures, *["0" * 8] * (2**signature_bits - len(signatures))] if has_signature_memory else signatures
    digits = address_bits // 4
    own = [register for register in registers.registers if not register.is_external]
    fields = [_field_configuration(register, field) for register in own for field in register.fields]
    kept = (Kind.STORAGE, Kind.STICKY, Kind.COUNTER)
    read = [
        field["field"] + ("_r" if Kind(field["kind"]) in kept else "") for field in fields if not field["is_constant"]
    ]
    return {
        "map": registers.name,
        "address_bits": address_bits,
        "has_signature_memory": has_signature_memory,
        "signature_bits": signature_bits,
        "channel_count": len(signatures),
        "last_signature": len(words) - 1,
        "signatures": [{"channel": number, "word": word} for number, word in enumerate(words)],
        "reads": read,
        "resets": [field for field in fields if Kind(field["kind"]) in kept],
        "registers": [
            {
                "name": register.name,
                "address": f"{register.address:0{digits}x}",
                "fields": [_field_configuration(register, field) for field in register.fields],
            }
            for register in own
        ],
        "writable": [
            {
                "name": register.name,
                "address": f"{register.address:0{digits}x}",
                "fields": [_field_configuration(register, field) for field in register.fields if field.is_writable],
            }
            for register in own
            if any(field.is_writable for field in register.fields)
        ],
        **{f"{kind.value}s": [field for field in fields if field["kind"] == kind.value] for kind in Kind},
        "interrupts": [field for field in fields if field["enable"]],
    }


def _field_configuration(register: Register, field: Field) -> Context:
    digits = f"{field.reset:0{field.width}b}"
    return {
        "field": f"{register.name}_{field.name}",
        "kind": field.kind.value,
        **{f"is_{kind.value}": field.kind is kind for kind in Kind},
        "is_bit": field.width == 1,
        "width": field.width,
        "high": field.low + field.width - 1,
        "low": field.low,
        "reset": digits,
        "full": "1" * field.width,
        "enable": field.enable,
    }
