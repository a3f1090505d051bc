"""The parameters of accelerators in the hardware: two registers of the status each, and the unit that holds the value.

`firm_parameter` changes the value in a cycle in which each input of the accelerator is between two messages. In a block
with another clock, the words of both registers cross in a `firm_cdc_word`.
"""

from __future__ import annotations

from fusesoc_firm.converter.message_ports import segment_count
from fusesoc_firm.converter.vhdl import hexadecimal, vhdl_type
from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    AcceleratorType,
    BlockParameter,
    DerivedSystem,
    MessageSide,
)
from fusesoc_firm.system.hardware.crossings import port_of
from fusesoc_firm.system.hardware.maps import instance
from fusesoc_firm.system.hardware.names import OWN_RESET, Names, parameter_words, reset_of
from fusesoc_firm.text.render import Context

WANTED_ADDRESS, VALUE_ADDRESS = 0x100, 0x104
"""The registers of the first parameter: the word that software wants, and the word in effect."""
BYTES = 8
"""The distance of the registers of two parameters."""


def wanted_address(number: int) -> int:
    """Return the address of the register with the word that software wants."""
    return WANTED_ADDRESS + BYTES * number


def value_address(number: int) -> int:
    """Return the address of the register with the word in effect."""
    return VALUE_ADDRESS + BYTES * number


def parameter_registers(parameters: tuple[BlockParameter, ...]) -> list[Context]:
    """Return the registers of parameters for the description of a status."""
    return [
        {
            "number": item.number,
            "name": item.name,
            "range": item.parameter.range,
            "type": item.parameter.type.name,
            "wanted": f"{wanted_address(item.number):03x}",
            "value": f"{value_address(item.number):03x}",
            "default": f"{item.parameter.word(item.parameter.default):08x}",
        }
        for item in parameters
    ]


def parameter_signals(names: Names, system: DerivedSystem) -> list[Context]:
    """Return the signals of each parameter: its port, and the words of its registers in both clock domains."""
    found = []
    for item in system.parameters:
        words = [names.parameter(item, word) for word in parameter_words(item, system)]
        found.append(
            {
                "name": item.name,
                "port": names.parameter(item),
                "type": vhdl_type(item.parameter.port_bits),
                "words": words,
            }
        )
    return found


def parameter_blocks(names: Names, system: DerivedSystem) -> list[Context]:
    """Return the units of the parameters of each block, and the sides that tell whether a message is under way."""
    by_block: dict[str, list[BlockParameter]] = {}
    for item in system.parameters:
        by_block.setdefault(item.block, []).append(item)
    blocks = {block.block: block for block in system.accelerators}
    return [
        {
            "between": names.between(block),
            "sides": [*_sides(names, blocks[block])],
            "instances": [unit for item in items for unit in _units(names, item, system)],
        }
        for block, items in by_block.items()
    ]


def _sides(names: Names, block: AcceleratorBlock) -> list[Context]:
    """Return the handshakes of all inputs, or of the outputs of an accelerator without inputs."""
    type_: AcceleratorType = block.type
    sides = type_.inputs or type_.outputs
    return [
        {
            "segment_valid": names.port(block.block, f"{side.prefix}segment_valid"),
            "zeros": "0" * segment_count(side.frame),
            "valid": names.port(block.block, f"{side.prefix}msg_valid") if _has_valid(side, type_) else "",
            "ready": names.port(block.block, f"{side.prefix}msg_ready"),
        }
        for side in sides
    ]


def _has_valid(side: MessageSide, type_: AcceleratorType) -> bool:
    return side in type_.inputs or not side.frame.is_fixed_size


def _units(names: Names, item: BlockParameter, system: DerivedSystem) -> list[Context]:
    """Return the unit of a parameter, and the crossings of its words if the block has another clock."""
    parameter, clock = item.parameter, system.clock_of(item.block)
    there, back = ("there", "back") if clock else ("wanted", "value")
    code = parameter.type.code
    unit = instance(
        names.label(item.block, parameter.name, "parameter"),
        "entity firm.firm_parameter",
        [
            ("clk", port_of(clock)),
            ("rst_n", reset_of(clock)),
            ("wanted", names.parameter(item, there)),
            ("between", names.between(item.block)),
            ("in_effect", names.parameter(item, back)),
            (f"value{'(0)' if code == '?' else ''}", names.parameter(item)),
        ],
        [
            ("BITS", parameter.type.bits),
            *([("IS_SIGNED", "true")] if code in "bhi" else []),
            *([("IS_FLOAT", "true")] if parameter.is_float else []),
            *((name, _literal(item, value)) for name, value in _limits(item)),
        ],
    )
    if not clock:
        return [unit]
    own, other = ("clk", OWN_RESET), (port_of(clock), reset_of(clock))
    ways = [("there", own, other, ("wanted", "there")), ("back", other, own, ("back", "value"))]
    return [
        unit,
        *(
            instance(
                names.label(item.block, parameter.name, word),
                "entity firm.firm_cdc_word",
                [
                    ("s_clk", source[0]),
                    ("s_rst_n", source[1]),
                    ("s_word", names.parameter(item, words[0])),
                    ("m_clk", sink[0]),
                    ("m_rst_n", sink[1]),
                    ("m_word", names.parameter(item, words[1])),
                ],
                [("INITIAL", _literal(item, parameter.default))],
            )
            for word, source, sink, words in ways
        ),
    ]


def _limits(item: BlockParameter) -> list[tuple[str, float]]:
    parameter = item.parameter
    return [
        ("LEAST", _limit(item, parameter.least)),
        ("MOST", _limit(item, parameter.most)),
        ("INITIAL", parameter.default),
    ]


def _limit(item: BlockParameter, value: float) -> float:
    return bool(value) if item.parameter.type.code == "?" else value


def _literal(item: BlockParameter, value: float) -> str:
    return hexadecimal(item.parameter.word(value).to_bytes(4, "little"))
