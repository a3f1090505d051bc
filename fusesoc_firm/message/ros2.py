"""ROS 2: the serialisation is little-endian XCDR version 1, as defined in DDS-XTYPES 1.3, section 7.4.

The first two bytes of the header name the encoding and are checked; the other two are options, which receivers ignore.
Writers pad a payload to a multiple of four bytes, so up to three trailing bytes may follow; after a message of variable
size, rclpy's `serialize_message` leaves more. There is no padding between the count of an empty sequence and the
following value.
"""

from functools import partial
from types import MappingProxyType

from fusesoc_firm.message import dialect, folders, parser, signature, stores
from fusesoc_firm.message.idl.names import SUFFIX
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import InterfaceKind
from fusesoc_firm.message.wire import INTEGER_AND_FLOAT, WireRules

_RULES = WireRules(
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

MIDDLEWARE = Middleware(
    number=2,
    title=dialect.ROS2.title,
    words=("ROS2",),
    rules=_RULES,
    parse=parser.parse_message,
    dialect=dialect.ROS2,
    signature=signature.rihs01,
    builtin_types=dialect.ROS2.builtin_types,
    suffixes={**{kind.value: kind for kind in InterfaceKind}, SUFFIX: None},
    folders=folders.ros2_folders,
    distributions=partial(stores.distributions, 2),
    store=partial(stores.DistributionStore, 2),
)
