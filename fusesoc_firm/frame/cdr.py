"""ROS 2's serialisation: XCDR version 1 as DDS-XTYPES 1.3, section 7.4, defines it, little-endian.

The header's first two bytes name the encoding and are checked; the other two are options that a receiver
ignores. Writers round a payload up to a multiple of four, so up to three bytes may trail. Nothing is padded
between the count of an empty sequence and what follows.
"""

from types import MappingProxyType

from fusesoc_firm.frame.rules import INTEGER_AND_FLOAT, WireRules

CDR_RULES = WireRules(
    scalars=MappingProxyType(
        {**INTEGER_AND_FLOAT, "byte": INTEGER_AND_FLOAT["uint8"], "char": INTEGER_AND_FLOAT["uint8"]}
    ),
    compounds=MappingProxyType({}),
    max_alignment=8,
    prefix=b"\x00\x01\x00\x00",
    checked_prefix=2,
    empty_bytes=1,
    string_terminator=1,
    trailing_bytes=3,
)
