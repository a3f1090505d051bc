"""Frames between ROS and a transport: queues, calls, traces and records."""
