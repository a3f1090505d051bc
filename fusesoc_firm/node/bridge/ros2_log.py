"""The lines of a node in ROS 2's log, which the terminal shows already."""

from __future__ import annotations

from typing import Any

_TOPIC = "/rosout"
# The log's publisher of rcl has this depth, and drops lines after this time in s.
_DEPTH, _LIFESPAN = 1000, 10


class Log:
    """A publisher of the log beside rclpy's own, whose lines the terminal would show a second time."""

    def __init__(self, node: Any) -> None:
        from rcl_interfaces.msg import Log as Line
        from rclpy.duration import Duration
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._node = node
        self._type = Line
        quality = QoSProfile(
            depth=_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=Duration(seconds=_LIFESPAN)
        )
        self.publisher = node.create_publisher(Line, _TOPIC, quality)

    def put(self, level: int, text: str) -> None:
        """Publish a line if the node's logger has this level; the numbers of rclpy are those of `logging`."""
        from rclpy.logging import LoggingSeverity

        logger = self._node.get_logger()
        if logger.is_enabled_for(LoggingSeverity(level)):
            stamp = self._node.get_clock().now().to_msg()
            self.publisher.publish(self._type(stamp=stamp, level=level, name=logger.name, msg=text))
