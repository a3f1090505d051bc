"""The ends of a node in ROS, its options and its diagnostics."""
