"""The node of a system: topics of a running ROS on one side, the hardware's transport on the other (docs/live.md)."""
