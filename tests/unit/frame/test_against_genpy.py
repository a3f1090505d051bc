"""ROS 1 layouts against genpy, what rospy itself serialises with; Debian has it as python3-genpy."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from keyword import iskeyword
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.message.model import RosVersion
from tests.unit.frame.oracle import Oracle
from tests.unit.frame.samples import AWKWARD

SEED = 20240603
VALUES_EACH = 6
# genpy takes an array of 0 elements for one of open size and sends a count; rosbags and we send nothing.
UNLIKE_GENPY = {"awkward_msgs/Zero"}


def python_with_genpy() -> str | None:
    """The first Python here that can import it."""
    for python in (sys.executable, "/usr/bin/python3"):
        if Path(python).exists():
            found = subprocess.run([python, "-c", "import genpy.dynamic"], capture_output=True, check=False)
            if found.returncode == 0:
                return python
    return None


def for_genpy(value: Any) -> Any:
    """The halves of a time are called secs and nsecs there, and a Python keyword gets a `_`."""
    if isinstance(value, dict):
        if value.keys() == {"sec", "nsec"}:
            return {f"{half}s": number for half, number in value.items()}
        return {f"{name}_" if iskeyword(name) else name: for_genpy(inner) for name, inner in value.items()}
    return [for_genpy(inner) for inner in value] if isinstance(value, list) else value


def test_bytes_are_those_of_genpy() -> None:
    python = python_with_genpy()
    if python is None:
        pytest.skip("needs genpy (Debian: python3-genpy)")
    print(f"seed {SEED}")
    source = random.Random(SEED)
    oracle = Oracle(RosVersion.ROS1, AWKWARD[RosVersion.ROS1])
    names = [name for name in (*oracle.fixed_size_messages(), *AWKWARD[RosVersion.ROS1]) if name not in UNLIKE_GENPY]
    values = {name: [oracle.random_value(name, source) for _ in range(VALUES_EACH)] for name in names}
    requests = [
        {"name": name, "text": oracle.definition_text(name), "values": [for_genpy(value) for value in values[name]]}
        for name in names
    ]
    script = Path(__file__).with_name("genpy_oracle.py")
    done = subprocess.run(
        [python, script], input=json.dumps(requests), capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    for name, payloads in zip(names, json.loads(done.stdout), strict=True):
        assert [encode(oracle.frame(name), value).hex() for value in values[name]] == payloads, name
