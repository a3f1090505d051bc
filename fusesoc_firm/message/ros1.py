"""ROS 1: the serialisation is little-endian, without alignment or prefix (dissertation, section 3.3)."""

from functools import partial
from types import MappingProxyType

from fusesoc_firm.message import dialect, folders, parser, signature, stores
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.wire import INTEGER_AND_FLOAT, WireRules

_uint32, _int32 = INTEGER_AND_FLOAT["uint32"], INTEGER_AND_FLOAT["int32"]

_RULES = WireRules(
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

MIDDLEWARE = Middleware(
    number=1,
    title=dialect.ROS1.title,
    # ROS 1 was simply called ROS before ROS 2.
    words=("ROS", "ROS1"),
    rules=_RULES,
    parse=parser.parse_message,
    dialect=dialect.ROS1,
    signature=signature.md5,
    builtin_types=dialect.ROS1.builtin_types,
    suffixes={kind.value: kind for kind in InterfaceKind},
    folders=folders.ros1_folders,
    distributions=partial(stores.distributions, 1),
    store=partial(stores.DistributionStore, 1),
    aliases=MappingProxyType({MessageName("tf", "tfMessage"): MessageName("tf2_msgs", "TFMessage")}),
)
