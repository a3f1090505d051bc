"""Messages of variable size that are difficult for converters, and that no distribution contains."""

from __future__ import annotations

from collections.abc import Mapping

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware

PACKAGE = "variable_msgs"

_SHARED = {
    "Text": "string text\n",
    "Bytes": "uint8[] data\n",
    "Numbers": "uint8 before\nfloat64[] many\nuint16[] halves\nfloat32 behind\nbool[] flags\n",
    # Elements of every size, at every possible start.
    "Sizes": "".join(f"uint8[] b{bits}\nuint{bits}[] n{bits}\nuint8 t{bits}\n" for bits in (8, 16, 32, 64)),
    "Texts": "string[] texts\nstring[3] three\nuint8 last\n",
    "Named": "string name\nfloat64 value\n",
    "Plain": "uint8 kind\nfloat64 value\n",
    "Plains": "Plain[] plains\nPlain[2] two\n",
    "Nameds": "Named[] many\nNamed[3] three\nNamed one\nuint8 last\n",
    # Arrays of messages that contain such arrays, at two levels.
    "Leaf": "uint16 id\nuint16[] data\n",
    "Branch": "string label\nLeaf[] leaves\nint64 weight\n",
    "Tree": "uint8 height\nBranch[] branches\nLeaf[2] roots\n",
    "Grid": "Branch[2] branches\nuint8[] tail\n",
    "Nothing": "",
    "Hollow": "uint8 first\nNothing[] nothings\nstring text\nNothing[2] two\n",
    "Flags": "bool a\nbool[3] b\nstring c\nbool d\nFlag[] e\n",
    "Flag": "bool on\nbool[2] more\n",
    # Names that the publisher itself uses.
    "Words": "".join(
        f"uint8 {word}\n" for word in "data index word valid last ready count length place header size step".split()
    )
    + "uint8[] words\nstring text\nPlain[] elements\nstring left\nuint8 max\nuint8 lanes\n",
    "Giant": "uint8[5000] before\nuint16 some\nstring name\nfloat64[3000] behind\nuint32 last\nuint8[1] odd\n",
    "Lying": "string[] texts\nfloat64[] many\nuint8[] data\nuint8 last\n",
    "Wide": "uint8[200] block\nstring text\nfloat32[50] numbers\n",
}
_ROS1 = {"Times": "time stamp\ntime[2] stamps\nstring text\nduration[3] spans\nuint8[] data\n"}
_ROS2 = {
    # Equal on the wire: rosbags does not support wstring, but it supports numbers of four bytes.
    "Units": "uint32[] text\nUnit[] texts\nuint8 last\n",
    "Unit": "uint32[] units\n",
    "Wides": "wstring text\nwstring[] texts\nuint8 last\n",
    "Bounded": "string<=5 text\nuint32[<=3] few\nstring<=4[<=2] texts\nfloat64[<=2] last\n",
}

VARIABLE: Mapping[Middleware, Mapping[str, str]] = {
    ROS1: {f"{PACKAGE}/{name}": text for name, text in {**_SHARED, **_ROS1}.items()},
    ROS2: {f"{PACKAGE}/{name}": text for name, text in {**_SHARED, **_ROS2}.items()},
}
