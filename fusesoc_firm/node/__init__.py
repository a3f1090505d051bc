"""What runs beside the hardware: the node between ROS and a transport."""
