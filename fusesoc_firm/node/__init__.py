"""The software beside the hardware: the node between ROS and a transport, in Python, C++ and C."""
