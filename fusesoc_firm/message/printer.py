"""Print a message as `.msg` text in a canonical, aligned form, which the parser reads back as the same message."""

from __future__ import annotations

from collections.abc import Sequence

from fusesoc_firm.message import ROS1
from fusesoc_firm.message.middleware import Definitions, MessageDefinition, Middleware
from fusesoc_firm.message.model import Constant, DefaultValue, MessageName, Scalar

# The line between a message and its nested messages in ROS's bags and connection headers.
_SEPARATOR = "=" * 80


def to_text(definition: MessageDefinition, signature: str = "") -> str:
    """Return the definition as `.msg` text: constants, then fields in wire order.

    A comment contains the message's name, its ROS version and, if given, the signature.

    The parser reads every printed value back unchanged (ROS 2 cannot express a `#`).
    """
    ros = definition.ros
    constants = [(str(c.type), c.name, f"= {_constant(c, ros)}") for c in definition.constants]
    fields = [(str(f.type), f.name, _default(f.default)) for f in definition.fields]
    header = [f"# {definition.name} ({ros.title})", *([f"# signature: {signature}"] if signature else [])]
    blocks = [header, _aligned(constants), _aligned(fields)]
    return "\n\n".join("\n".join(block) for block in blocks if block) + "\n"


def closure_text(name: MessageName, definitions: Definitions) -> str:
    """Return the texts of a message and of all others in `definitions`, joined as in bags and connection headers."""
    others = [f"{_SEPARATOR}\nMSG: {other}\n{to_text(definitions[other])}" for other in definitions if other != name]
    return "".join([to_text(definitions[name]), *others])


def _aligned(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    widths = [max((len(row[column]) for row in rows), default=0) for column in (0, 1)]
    return [f"{kind:{widths[0]}} {name:{widths[1]}} {value}".rstrip() for kind, name, value in rows]


def _constant(constant: Constant, ros: Middleware) -> str:
    # ROS 1's MD5 sum depends on the value's text, and must not change when a message is printed.
    return constant.text if ros is ROS1 else _scalar(constant.value)


def _default(value: DefaultValue | None) -> str:
    if value is None:
        return ""
    if isinstance(value, tuple):
        return f"[{', '.join(_element(element) for element in value)}]"
    return _scalar(value)


def _element(value: Scalar) -> str:
    # Within an array, `\"` never closes a string, so a string that ends in `\` is printed without quotes.
    return value if isinstance(value, str) and value.endswith("\\") else _scalar(value)


def _scalar(value: Scalar) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # Only an `.idl` file can have line ends in a string.
        quoted = value.replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
        return f'"{quoted}"'
    return str(value)
