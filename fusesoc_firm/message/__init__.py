"""What a message is: its model, where definitions come from, and the middlewares, each with a line here."""

from fusesoc_firm.message import ros1, ros2
from fusesoc_firm.message.middleware import register

register(ros1.MIDDLEWARE)
register(ros2.MIDDLEWARE)
