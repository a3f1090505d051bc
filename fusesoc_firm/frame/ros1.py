"""ROS 1's serialisation: little-endian, nothing aligned, nothing in front (dissertation, section 3.3)."""

from types import MappingProxyType

from fusesoc_firm.frame.rules import INTEGER_AND_FLOAT, WireRules

_uint32, _int32 = INTEGER_AND_FLOAT["uint32"], INTEGER_AND_FLOAT["int32"]

ROS1_RULES = WireRules(
    scalars=MappingProxyType(
        {**INTEGER_AND_FLOAT, "byte": INTEGER_AND_FLOAT["int8"], "char": INTEGER_AND_FLOAT["uint8"]}
    ),
    compounds=MappingProxyType(
        {
            "time": (("sec", _uint32), ("nsec", _uint32)),
            "duration": (("sec", _int32), ("nsec", _int32)),
        }
    ),
    max_alignment=1,
    prefix=b"",
    checked_prefix=0,
    empty_bytes=0,
    string_terminator=0,
    trailing_bytes=0,
)
