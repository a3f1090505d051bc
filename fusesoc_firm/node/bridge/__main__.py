"""Run the bridge from its folder, as a package of its own: the Python of ROS does not know fusesoc_firm."""

import sys
from importlib import import_module
from pathlib import Path

# Only the package itself is wanted from here.
sys.path[0] = str(Path(__file__).resolve().parent.parent)
sys.exit(import_module("bridge.main").main())
