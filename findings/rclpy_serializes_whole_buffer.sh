#!/bin/sh
# Guess:    `serialize_message` of rclpy returns the bytes of the message, padded to a multiple of four at most.
# Really:   it returns its whole buffer, whose size was estimated: with empty sequences of 8-byte numbers, four bytes more
#           for each. `publish(bytes)` sends them, and bags keep them. rclpy reads such bytes; rosbags refuses them.
# Versions: ros-kilted-rclpy 9.1.2, ros-kilted-rmw-fastrtps-cpp 9.3.3; the same with ros-jazzy-rclpy 7.1.6
# Met by:   authors of readers of CDR, of bags and of hashes of payloads
# Remedy:   trim a payload by its definition
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install ros-kilted-rclpy==9.1.2 ros-kilted-rmw-fastrtps-cpp==9.3.3 ros-kilted-sensor-msgs==5.5.1 \
  rosbags==0.11.9 2>log || { tail -n 1 log >&2; echo "needs a Python with wheels of ROS 2, such as 3.11" >&2; exit 2; }

cat > serialize.py <<'PYTHON'
from importlib.metadata import version

import numpy
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState

message = JointState(name=["elbow"], position=[1.0])
sent = serialize_message(message)
assert deserialize_message(sent, JointState) == message
store = get_typestore(Stores.ROS2_KILTED)
Header, Time = (store.types[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
JointStates = store.types["sensor_msgs/msg/JointState"]
none = numpy.zeros(0)
alike = JointStates(Header(Time(0, 0), ""), ["elbow"], numpy.ones(1), none, none)
content = bytes(store.serialize_cdr(alike, JointStates.__msgtype__))
print("rclpy", version("ros-kilted-rclpy"), "rosbags", version("rosbags"))
print("guess:", len(content), "bytes, or up to 3 more")
print("seen: ", len(sent), "bytes")
suffices = deserialize_message(sent[: len(content)], JointState) == message
raise SystemExit(not (suffices and len(sent) > len(content) + 3))
PYTHON
env/bin/python serialize.py
