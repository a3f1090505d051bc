#!/bin/sh
# Guess:    `wstring<=9[] names` in a .msg file is an array of any length, whose texts have up to nine characters, as
#           `string<=9[] names` is.
# Really:   rosidl_parser takes the bound of the text for that of the array, too: an array of up to nine texts. Generated
#           code refuses longer arrays, and the type hash differs from that of the array that the file declares.
# Versions: ros-rosidl-parser and ros-rosidl-adapter 4.9.5 (Kilted); the same with 4.6.6 (Jazzy)
# Source:   `get_abstract_type` in rosidl_parser/parser.py searches the whole tree of `sequence` for a bound, and ignores
#           one below `string_type`, but not below `wide_string_type`
# Met by:   authors of messages with wide strings, and of other readers of ROS 2's definitions
# Instead:  `wstring[]`, or an array with its own bound, `wstring<=9[<=100]`
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install ros-rosidl-parser==4.9.5 ros-rosidl-adapter==4.9.5 'empy<4' 2>log ||
  { tail -n 1 log >&2; echo "needs a Python with wheels of ROS 2, such as 3.11" >&2; exit 2; }

mkdir -p example_msgs/msg
cat > example_msgs/msg/Texts.msg <<'MSG'
string<=9[] narrow
wstring<=9[] wide
MSG
cat > look.py <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_parser.definition import Message
from rosidl_parser.parser import parse_idl_string

print("ros-rosidl-parser", version("ros-rosidl-parser"), "ros-rosidl-adapter", version("ros-rosidl-adapter"))
here = Path.cwd()
idl = convert_msg_to_idl(here / "example_msgs", "example_msgs", Path("msg/Texts.msg"), here / "idl")
content = parse_idl_string(idl.read_text())
(message,) = content.get_elements_of_type(Message)
narrow, wide = (type(member.type).__name__ for member in message.structure.members)
bound = getattr(message.structure.members[1].type, "maximum_size", None)
print("guess: both arrays are an UnboundedSequence")
print("narrow:", narrow)
print("wide:  ", wide, bound)
raise SystemExit(not (narrow == "UnboundedSequence" and wide == "BoundedSequence" and bound == 9))
PYTHON
env/bin/python look.py
