"""Message definitions: their model, the sources they are read from, and the ROS middlewares."""

from fusesoc_firm.message import ros1, ros2
from fusesoc_firm.message.middleware import register

register(ros1.MIDDLEWARE)
register(ros2.MIDDLEWARE)
