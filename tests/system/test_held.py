"""A compiled function of two messages, one of which waits in the host's channel for the other, is warned of."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.system.derived.derivation import derive
from tests.system.systems import LIBRARIES, accelerator, converter, instance, read, specification

STATE, POINT = "sensor_msgs/JointState", "geometry_msgs/Point"


def warnings(folder: Path, first: str, second: str, kind: str = "Python", keys: str = "") -> list[str]:
    (folder / "acc.py").write_text("def f(one, other):\n    return {}\n", encoding="utf-8")
    blocks = converter("one", "subscriber", first, "f").replace("}\n", f"{keys}}}\n")
    blocks += converter("other", "subscriber", second, "f") + instance("f", "f", "out")
    blocks += converter("out", "publisher", POINT)
    source = "acc.py" if kind == "Python" else "acc.vhd"
    found, faults = read(folder, specification(blocks, accelerator("f", f"{first} {second}", POINT, kind, source)))
    derive(found, folder, LIBRARIES, faults)
    return [item.message + str(item.source) for item in faults.warned]


def test_a_message_that_waits_for_another_one_needs_a_queue(tmp_path: Path) -> None:
    (warning,) = warnings(tmp_path, STATE, POINT)
    assert warning.startswith("'one' holds the channel until 'f' has the message of 'other', too")
    assert ":5:12" in warning


@pytest.mark.parametrize(
    ("first", "second", "kind", "keys"),
    [
        (POINT, POINT, "Python", ""),
        (STATE, POINT, "VHDL", ""),
        (STATE, POINT, "Python", ", queue: 2, maxLength: 400"),
    ],
)
def test_other_messages_do_not_wait(first: str, second: str, kind: str, keys: str, tmp_path: Path) -> None:
    assert warnings(tmp_path, first, second, kind, keys) == []
