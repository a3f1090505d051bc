"""Run the bridge from its folder, as a separate package: the Python of ROS lacks fusesoc_firm."""

import sys
from importlib import import_module
from pathlib import Path

# Only the package itself may be imported from here.
sys.path[0] = str(Path(__file__).resolve().parent.parent)
sys.exit(import_module("bridge.main").main())
