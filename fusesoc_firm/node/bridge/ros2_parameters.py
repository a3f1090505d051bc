"""The parameters of the hardware as those of a node of ROS 2."""

from __future__ import annotations

from typing import Any

from .ros import Ros

_KINDS = {"bool": "BOOL", "float32": "DOUBLE"}


def declare(node: Any, parameters: list[dict[str, Any]], ros: Ros) -> None:
    """Declare the parameters, and let `ros` set their values and report refused ones."""
    from rcl_interfaces.msg import SetParametersResult

    for item in parameters:
        node.declare_parameter(item["name"], item["value"], _descriptor(item))
    own = {item["name"] for item in parameters}

    def change(changed: list[Any]) -> Any:
        values = {item.name: item.value for item in changed if item.name in own}
        reason = ros.set_parameters(values) if values else ""
        return SetParametersResult(successful=not reason, reason=reason)

    set_all = node.set_parameters_atomically

    def reported(wanted: list[Any]) -> Any:
        result = set_all(wanted)
        if not result.successful:
            ros.refused([item.name for item in wanted], result.reason)
        return result

    node.add_on_set_parameters_callback(change)
    # rclpy refuses values outside of the range before its callbacks; its services call this method.
    node.set_parameters_atomically = reported


def _descriptor(item: dict[str, Any]) -> Any:
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType

    made = ParameterDescriptor(
        name=item["name"],
        type=getattr(ParameterType, f"PARAMETER_{_KINDS.get(item['type'], 'INTEGER')}"),
        description=item["description"],
    )
    if item["type"] == "float32":
        made.floating_point_range = [FloatingPointRange(from_value=float(item["least"]), to_value=float(item["most"]))]
    elif item["type"] != "bool":
        made.integer_range = [IntegerRange(from_value=item["least"], to_value=item["most"])]
    return made
