"""How long a Point takes from the system of one board to that of another, whose PHYs are connected at 1 Gb/s."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.core.request import Request
from tests.cores.test_net_link import NODE
from tests.fabric.test_generated_node import PARTS
from tests.hdl.ghdl import REPOSITORY, Library, core_files

HERE = Path(__file__).parent
_PAGE = REPOSITORY / "docs" / "reference" / "ethernet.md"
COUNT = 20
NANOSECONDS = 8  # of a cycle
# Each reads the topic that the other one writes.
SPECIFICATION = """\
project:
  name: {name}
  width: 8
  clock: 125 MHz
  interconnect: ethernet
  network: {{mac: "02:00:00:00:00:0{number}", address: 192.0.2.{number}, phy: gmii}}
blocks:
  - {{name: point_in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, topic: /{read},
     qos: {{reliability: best_effort}}, outgoing: [{{name: point_out}}]}}
  - {{name: point_out, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, topic: /{written},
     qos: {{reliability: best_effort}}}}
"""


def _node(folder: Path, name: str, number: int, read: str, written: str) -> list[Path]:
    """The node of a board. Its millisecond is that of a simulated one, or they would be found after 50 M cycles."""
    text = SPECIFICATION.format(name=name, number=number, read=read, written=written)
    (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    others = dict.fromkeys(("board", "paths", "distro"))
    parameters = {"spec": f"{name}.yaml", "product": "system", "clock": "250 kHz", **others}
    files = GENERATORS["far"].load(Request("far", f"test:sys:{name}-system:0", folder, parameters)).generate().files
    paths = [folder / f"{name}_system_{part}.vhd" for part in PARTS]
    for path in paths:
        path.write_text(str(files[path.name].content), encoding="utf-8")
    return paths


@pytest.mark.check
def test_a_point_between_two_boards_takes_as_long_as_the_page_says(tmp_path: Path) -> None:
    library = Library("firm", tmp_path)
    nodes = [*_node(tmp_path, "talker", 1, "unused", "way"), *_node(tmp_path, "listener", 2, "way", "unread")]
    library.analyse([*core_files(*NODE, "cdc/sync", "cdc/cdc", "net/mii"), *nodes, HERE / "one_way.vhd"])
    result = library.run("one_way", {"COUNT": COUNT}, directory=tmp_path, seconds=600)
    assert result.exit_code == 0, result.output
    cycles = sorted(map(int, (tmp_path / "one_way.txt").read_text(encoding="ascii").split()))
    print(cycles, f"{NANOSECONDS * cycles[COUNT // 2]} ns")
    assert len(cycles) == COUNT
    told = re.search(r"of a `Point`, of best effort, .*\| about (\d+) cycles", _PAGE.read_text(encoding="utf-8"))
    assert told
    # Half of them leave while the node has nothing else to do.
    assert cycles[COUNT // 2] == pytest.approx(int(told[1]), rel=0.05)
