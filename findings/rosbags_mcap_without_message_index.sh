#!/bin/sh
# Guess:    rosbags reads all messages of an MCAP file that other readers read.
# Really:   if the chunks have no message index, which is optional in MCAP, rosbags opens the file, counts its messages
#           from the statistics, and yields none, without an error. mcap's own reader yields all.
# Versions: rosbags 0.11.9, mcap 1.6.0
# Source:   `McapReader` in rosbags/rosbag2/storage_mcap.py skips chunks without an index; MCAP's specification, "Chunk
#           Index"; mcap's own reader had the same fault until its issue 1735
# Met by:   owners of files whose recorder leaves the index out to save space
# Instead:  write the file anew with mcap's reader and writer
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install rosbags==0.11.9 mcap==1.6.0

cat > compare.py <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import IndexType, Writer
from rosbags.rosbag2 import Reader

MESSAGES = 5


def write(path, indexes):
    with path.open("wb") as file:
        writer = Writer(file, index_types=indexes)
        writer.start(profile="ros2", library="example")
        schema = writer.register_schema("std_msgs/msg/Int32", "ros2msg", b"int32 data\n")
        channel = writer.register_channel("/numbers", "cdr", schema)
        for number in range(MESSAGES):
            data = b"\x00\x01\x00\x00" + number.to_bytes(4, "little")
            writer.add_message(channel, log_time=number, publish_time=number, data=data)
        writer.finish()


def counts(path):
    with path.open("rb") as file:
        by_mcap = len([*make_reader(file).iter_messages()])
    with Reader(path) as reader:
        return by_mcap, reader.message_count, len([*reader.messages()])


write(Path("with.mcap"), IndexType.ALL)
write(Path("without.mcap"), IndexType.ALL & ~IndexType.MESSAGE)
seen = [counts(Path(name)) for name in ("with.mcap", "without.mcap")]
print("rosbags", version("rosbags"), "mcap", version("mcap"))
print(f"guess: {MESSAGES} messages in both files, in both libraries")
for name, (by_mcap, announced, by_rosbags) in zip(("with", "without"), seen):
    print(f"seen:  {name} message index: mcap reads {by_mcap}; rosbags announces {announced} and reads {by_rosbags}")
raise SystemExit(seen != [(MESSAGES, MESSAGES, MESSAGES), (MESSAGES, MESSAGES, 0)])
PYTHON
env/bin/python compare.py
