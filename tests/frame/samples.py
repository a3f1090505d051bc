"""Messages that are difficult for layouts or hardware generators, and that no distribution contains."""

from __future__ import annotations

from collections.abc import Mapping

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware

PACKAGE = "awkward_msgs"

# Reserved words of VHDL and Verilog, and names in the converters: each must still work as a field.
_WORDS = """
    entity signal in out is others process wait case all always wire reg assign logic module bit byte packed
    clk rst_n s_axis_tdata s_axis_tready m_axis_tdata m_axis_tvalid segment_valid msg_valid msg_ready frame_error
    frame_error_code id frame frame_bytes position_r position_last trailing_r carry_r fields_r fault fault_r beat_fault
    ready beat store check receive send u_select rtl firm work ieee std numeric_std std_logic std_logic_vector unsigned
    natural integer to_unsigned resize rising_edge failure code_t no_fault end_position msg_valid_r word index words
""".split()

_SHARED = {
    "Nothing": "",
    "OneByte": "uint8 data\n",
    "OneFlag": "bool data\n",
    "Words": "".join(f"uint8 {word}\n" for word in _WORDS),
    "Flags": "bool first\nbool[9] many\nuint16 between\nbool[1] one\nbool last\n",
    "Unaligned": "bool flag\nfloat64 value\nuint8 tail\n",
    # In CDR the elements have different gaps, since each starts where the previous one ended.
    "Gaps": "Unaligned[3] elements\nuint16[3] triple\nUnaligned single\nint64 last\n",
    "Cell": "int8 kind\nuint16[2] pair\n",
    "Row": "Cell[3] cells\nfloat32 weight\n",
    "Grid": "bool before\nRow[2] rows\nfloat64 behind\n",
    "Hollow": "Nothing nothing\nuint8 value\nNothing[3] nothings\nfloat64 last\n",
    "Signed": "byte b\nchar c\nint8 i\nbyte[3] bs\nchar[2] cs\nint16[2] words\n",
    # The names of two leaves become equal when their paths are joined.
    "Inner": "uint8 b\nuint8 b_c\n",
    "Joined": "Inner a\nuint16 a_b\nuint16 a_b_2\nuint16 a_b_c\n",
    "Numbers": (
        "int8 i8\nuint8 u8\nint16 i16\nuint16 u16\nint32 i32\nuint32 u32\nint64 i64\nuint64 u64\n"
        "float32 f32\nfloat64 f64\n"
    ),
    "Long": "uint8[300] data\nfloat32 last\n",
    "Large": "float64[140] data\nbool flag\nuint16 tail\n",
}

_ROS1 = {
    "Times": "time stamp\nduration[2] spans\ntime[2] stamps\nuint8 last\n",
    "Mixed": "uint8 Stamp\nuint8 stamp\nuint8 a__b\nuint8 trailing_\nuint8 A__B\nuint8 In\nuint8 CLK\nuint8 x_\n",
    "Zero": "uint8[0] none\nuint16 value\nInner[0] nobody\nbool[0] nowhere\n",
}

# The payload is 4 bytes longer. With up to 3 trailing bytes, the lengths lead to a carry out of the length's low byte.
_ROS2 = {
    "Tuned": "uint8 gain 7\nfloat32 rate 0.5\n",
    "Defaults": """float64 x 1.5\nint16[3] triple [1, -2, 3]\nbool flag true\nuint8 plain\nTuned tuned\nTuned[2] pair
        int64 big -5\nbool[2] flags [true, false]\nchar letter 65\nfloat32[2] small [-0.25, 1e10]\n""",
}
_ROS2 |= {f"Carry{payload}": f"uint8[{payload - 4}] data\n" for payload in (252, 253, 254, 255, 256, 511, 1021)}

AWKWARD: Mapping[Middleware, Mapping[str, str]] = {
    ROS1: {f"{PACKAGE}/{name}": text for name, text in {**_SHARED, **_ROS1}.items()},
    ROS2: {f"{PACKAGE}/{name}": text for name, text in {**_SHARED, **_ROS2}.items()},
}

_VARIABLE_SHARED = {
    "Text": "string text\n",
    "Late": "string[] names\nuint8 flag\nfloat64[] data\nbool last\n",
    "Pair": "string key\nuint8[] value\n",
    "Deep": "uint8 a\nMiddle[] middles\nuint16 b\n",
    "Middle": "float64 x\nPair[] pairs\nuint8[3] y\nstring[2] names\n",
    "Fixtures": "Pair[2] pairs\nstring[3] names\n",
    "Tails": "Tail[] tails\nuint32 number\n",
    "Tail": "uint8 kind\nfloat64[] values\n",
    "Hollows": "Nothing[] nothings\nuint8[] behind\n",
    "Hollow": "Nothing[] nothings\n",
    "Nothing": "",
    "Halves": "int16[] halves\nint64[] longs\nuint32[] words\nbool[] flags\nfloat32[] floats\n",
    "Clashes": (
        "uint8[] data\nuint32 data_length\nbool data_axis_tvalid\nPair[] pairs\nbool pairs_valid\nuint8 pairs_ready\n"
        "string entity\nuint8 step_r\nuint8 window_bytes\nuint8 length_1_r\nuint8 payload_length\nuint8 closing_1\n"
    ),
    "Wide": "uint8 first\nfloat64[40] block\nstring name\nCell[3] cells\nuint16 last\n",
    "Cell": "int8 kind\nuint16[2] pair\n",
}

_VARIABLE_ROS2 = {
    "Bounded": "string<=5 name\nuint16[<=3] counts\nstring<=4[<=2] names\nPair[<=2] pairs\nuint8 last\n",
    "Unicode": "uint8 first\nwstring text\nwstring[] texts\nuint8 last\n",
}

AWKWARD_VARIABLE: Mapping[Middleware, Mapping[str, str]] = {
    ROS1: {f"{PACKAGE}/{name}": text for name, text in _VARIABLE_SHARED.items()},
    ROS2: {f"{PACKAGE}/{name}": text for name, text in {**_VARIABLE_SHARED, **_VARIABLE_ROS2}.items()},
}
