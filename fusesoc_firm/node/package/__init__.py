"""ROS packages of generated nodes."""
