"""Message definitions: their model, the sources they are read from, and the ROS middlewares."""

from fusesoc_firm.message.middleware import register
from fusesoc_firm.message.ros1 import MIDDLEWARE as ROS1
from fusesoc_firm.message.ros2 import MIDDLEWARE as ROS2

__all__ = ["ROS1", "ROS2"]

register(ROS1)
register(ROS2)
