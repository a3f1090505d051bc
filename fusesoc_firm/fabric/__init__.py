"""A ROS 2 node in fabric: what its hardware sends and compares, as plain values."""
