#!/bin/sh
# Guess:    the MD5 sum that rosbags computes for a ROS 1 message is the one that roscpp and rospy compare.
# Really:   ROS 1 hashes a constant's value as it is written; rosbags hashes the number. `uint8 MODE=0x1F` or
#           `float32 G=9.80` get another sum, so a real subscriber refuses the connection and tools find a mismatch.
#           Integers in decimal digits and short floats such as 9.8 are right.
# Versions: rosbags 0.11.9
# Source:   `compute_md5_text` in genmsg/gentools.py of ROS 1 takes `val_text`; ROS' documentation of msg, "MD5 sum"
# Met by:   authors of bags and bridges without ROS for messages with such constants
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install rosbags==0.11.9

cat > compare.py <<'PYTHON'
from hashlib import md5
from importlib.metadata import version

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# In these messages, the text that ROS 1 hashes is the definition itself without the last line end: constants first,
# single blanks, no comments.
CASES = {
    "Plain": ("uint8 MODE=31\nuint8 mode\n", True),
    "Hexadecimal": ("uint8 MODE=0x1F\nuint8 mode\n", False),
    "Short": ("float32 G=9.8\nfloat32 g\n", True),
    "Zero": ("float32 G=9.80\nfloat32 g\n", False),
    "Exponent": ("float64 LIMIT=1e3\nfloat64 limit\n", False),
}
store = get_typestore(Stores.ROS1_NOETIC)
print("rosbags", version("rosbags"))
print("guess: all sums are equal to those of ROS 1")
wrong = []
for name, (text, equal) in CASES.items():
    store.register(get_types_from_msg(text, f"example_msgs/msg/{name}"))
    definition, by_rosbags = store.generate_msgdef(f"example_msgs/msg/{name}", ros_version=1)
    by_ros = md5(text.rstrip("\n").encode()).hexdigest()
    print(f"seen:  {text.splitlines()[0]:18} ROS 1 {by_ros[:8]}..., rosbags {by_rosbags[:8]}...")
    if (by_ros == by_rosbags) != equal:
        wrong.append(name)
raise SystemExit(bool(wrong))
PYTHON
env/bin/python compare.py
