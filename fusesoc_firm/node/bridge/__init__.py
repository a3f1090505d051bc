"""The ROS process of a Python node; `main.py` describes it."""
