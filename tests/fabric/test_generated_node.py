"""The generated node of a system, simulated with its memories by GHDL."""

from __future__ import annotations

import zlib
from pathlib import Path

from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.core.request import Request
from fusesoc_firm.fabric import rtps
from tests.cores.test_net_link import NODE
from tests.fabric.messages import Data, parse
from tests.hdl.ghdl import Library, core_files

HERE = Path(__file__).parent
PARTS = ("control", "packets", "names", "node")
PREAMBLE = bytes([0x55] * 7 + [0xD5])
HEADER_BYTES, FCS_BYTES = 14 + 20 + 8, 4
MAC = bytes.fromhex("020000000002")
SPECIFICATION = """\
project:
  name: turtle
  width: 8
  clock: 25 MHz
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:02", address: 192.0.2.9, phy: mii}
blocks:
  - {name: turn, middleware: ROS2, mode: subscriber, message: geometry_msgs/Quaternion, outgoing: [{name: turned}]}
  - {name: turned, middleware: ROS2, mode: publisher, message: geometry_msgs/Quaternion}
"""


def hardware(folder: Path, clock: str = "250 kHz", specification: str = SPECIFICATION) -> list[Path]:
    """The node; its clock is that of a simulated board."""
    (folder / "turtle.yaml").write_text(specification, encoding="utf-8")
    others = dict.fromkeys(("board", "paths", "distro"))
    parameters = {"spec": "turtle.yaml", "product": "system", "clock": clock, **others}
    files = GENERATORS["far"].load(Request("far", "test:sys:turtle-system:0", folder, parameters)).generate().files
    paths = [folder / f"turtle_system_{part}.vhd" for part in PARTS]
    for path in paths:
        path.write_text(str(files[path.name].content), encoding="utf-8")
    return paths


def test_it_says_farewell_first(tmp_path: Path) -> None:
    """Peers that know the board from before its reset forget it then."""
    library = Library("firm", tmp_path)
    library.analyse([*core_files(*NODE), *hardware(tmp_path), HERE / "playing_node.vhd"])
    (tmp_path / "line.txt").touch()
    result = library.run("playing_node", {"LAST_CYCLES": 3500}, directory=tmp_path)
    assert result.exit_code == 0, result.output
    sent = bytes(map(int, (tmp_path / "sent.txt").read_text(encoding="ascii").split()))
    assert sent.startswith(PREAMBLE)
    frame, fcs = sent[len(PREAMBLE) : -FCS_BYTES], sent[-FCS_BYTES:]
    assert int.from_bytes(fcs, "little") == zlib.crc32(frame)
    assert frame[6:12] == MAC
    message = parse(frame[HEADER_BYTES:])
    assert message is not None
    assert message.prefix == rtps.VENDOR + MAC + bytes(4)
    (data,) = message.submessages
    assert isinstance(data, Data)
    assert data.writer == rtps.PARTICIPANT_WRITER
    assert data.status == rtps.DISPOSED | rtps.UNREGISTERED
