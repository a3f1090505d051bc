"""A system that is a node of ROS 2 itself: checked, shown, and generated."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import Request
from fusesoc_firm.system.boards.board import read_board
from fusesoc_firm.system.hardware.status import Features, Part, network_words, status_map
from fusesoc_firm.text.diagnostics import InputError
from tests.hdl.ghdl import REPOSITORY

SPECIFICATION = """\
project:
  name: turtle
  clock: 125 MHz
  interconnect: ethernet
  network: {mac: 02:0A:00:00:00:02, address: 192.0.2.9, gateway: 192.0.2.254, namespace: /lab}
blocks:
  - {name: turn, middleware: ROS2, mode: subscriber, message: geometry_msgs/Quaternion, qos: {profile: sensor_data},
     outgoing: [{name: turned}]}
  - {name: turned, middleware: ROS2, mode: publisher, message: geometry_msgs/Quaternion, qos: {profile: sensor_data}}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "turtle.yaml"
    made.write_text(SPECIFICATION, encoding="utf-8")
    return made


def test_it_is_checked_and_shown(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["system", "check", str(path)]) == 0
    # Two slots of 64 bytes, of which a quaternion takes 36.
    assert "the node needs 128 bytes of memory for the last messages of its publishers\n" in capsys.readouterr().out
    assert main(["system", "show", str(path)]) == 0
    shown = yaml.safe_load(capsys.readouterr().out)["System"]
    assert shown["interconnect"] == "ethernet"
    assert shown["network"] == {
        "mac": "02:0a:00:00:00:02",
        "address": "192.0.2.9",
        "netmask": "255.255.255.0",
        "gateway": "192.0.2.254",
        "name": "turtle",
        "namespace": "/lab",
        "domain": 0,
        "phy": "gmii",
        "reassemblies": 1,
    }


def test_its_address_may_come_by_dhcp(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = path.read_text(encoding="utf-8").replace("192.0.2.9, gateway: 192.0.2.254", "dhcp")
    path.write_text(text, encoding="utf-8")
    assert main(["system", "show", str(path)]) == 0
    shown = yaml.safe_load(capsys.readouterr().out)["System"]["network"]
    assert shown["address"] == "dhcp"
    assert not {"netmask", "gateway"} & {*shown}
    files = _files(path.parent)
    assert re.search(r"HAS_DHCP +=> true", files["turtle_system_node.vhd"])
    # A node with a constant address has no packets of DHCP.
    assert " dhcp\n" in files["turtle_system_packets.vhd"]
    path.write_text(SPECIFICATION, encoding="utf-8")
    files = _files(path.parent)
    assert re.search(r"HAS_DHCP +=> false", files["turtle_system_node.vhd"])
    assert " dhcp\n" not in files["turtle_system_packets.vhd"]


def test_no_node_on_a_host_serves_it(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (["live", str(path), "--transport", "uart:/dev/null"], ["system", "node", str(path)]):
        assert main(command) == 1
        assert "'turtle' is a node itself, and needs none on a host" in capsys.readouterr().err


def _request(folder: Path, **parameters: str) -> Request:
    known = {"spec": "turtle.yaml", "product": "system", **dict.fromkeys(("board", "paths", "distro"))}
    return Request("far", "test:sys:turtle-system:0", folder, {**known, **parameters})


def _files(folder: Path, **parameters: str) -> dict[str, str]:
    files = GENERATORS["far"].load(_request(folder, **parameters)).generate().files
    return {name: str(file.content) for name, file in files.items()}


def test_its_node_comes_before_its_top_level(path: Path) -> None:
    names = [*_files(path.parent)]
    parts = ("control", "packets", "names", "node")
    assert [name for name in names if name.startswith("turtle_system_")] == [
        f"turtle_system_{name}.vhd" for name in parts
    ]
    assert names.index("turtle_system_node.vhd") < names.index("turtle_system.vhd")


def test_it_has_streams_instead(path: Path) -> None:
    files = _files(path.parent, interconnect="axi_stream")
    assert "s_axis_tdata     : in" in files["turtle_system.vhd"]
    assert not [name for name in files if name.startswith("turtle_system_")]


@pytest.mark.parametrize(
    ("phy", "clock"),
    [("gmii", "125 MHz"), ("mii", "25 MHz"), ("mii", "100 MHz"), ("rgmii", "125 MHz"), ("rmii", "50 MHz")],
)
def test_each_phy_has_its_pins(path: Path, phy: str, clock: str) -> None:
    text = path.read_text(encoding="utf-8").replace("125 MHz", clock).replace("namespace", f"phy: {phy}, namespace")
    path.write_text(text, encoding="utf-8")
    top = _files(path.parent)["turtle_system.vhd"]
    assert f"u_phy : entity firm.firm_{phy}" in top
    assert f"    {phy}_rxd " in top


def test_its_node_has_the_numbers_of_the_specification(path: Path) -> None:
    text = path.read_text(encoding="utf-8").replace("namespace", "domain: 3, namespace")
    path.write_text(text, encoding="utf-8")
    node = _files(path.parent)["turtle_system_node.vhd"]
    # The ports 8150, 8160 and 8161, the first one in the lowest bits.
    for line in (
        'x"020a00000002"',
        'x"c0000209"',
        'x"1fe11fe01fd6"',
        "CLOCK_HZ            => 125000000",
        "SAMPLE              => 64",
    ):
        assert line in node
    assert "--   0  rt/lab/turn\n" in node


def test_its_node_has_the_qualities_of_the_specification(path: Path) -> None:
    """From the lowest bit on: the subscriber, the publisher, and `ros_discovery_info`, which is not in the history."""
    first, last = SPECIFICATION.rsplit("{profile: sensor_data}", 1)
    path.write_text(f"{first}{{durability: transient_local, depth: 5}}{last}", encoding="utf-8")
    node = _files(path.parent)["turtle_system_node.vhd"]
    assert 'ARE_RELIABLE  : std_logic_vector(2 downto 0) := "110"' in node
    assert 'ARE_TRANSIENT : std_logic_vector(2 downto 0) := "110"' in node
    assert "constant SLOTS   : integer := 8;" in node


def test_a_board_brings_its_phy_and_its_clock(path: Path) -> None:
    files = _files(path.parent, board="ulx3s_lan8720")
    assert {"turtle_ulx3s_lan8720.vhd", "ulx3s_lan8720.lpf"} < set(files)
    assert "u_phy : entity firm.firm_rmii" in files["turtle_system.vhd"]
    assert "CLOCK_HZ            => 50000000" in files["turtle_system_node.vhd"]
    assert 'LOCATE COMP "rmii_rxd[1]" SITE "B9";' in files["ulx3s_lan8720.lpf"]


def test_its_status_counts_the_faults_of_its_network(path: Path) -> None:
    assert "HAS_STATUS          => false" in _files(path.parent)["turtle_system_node.vhd"]
    text = path.read_text(encoding="utf-8").replace("interconnect:", "status: frames\n  interconnect:")
    path.write_text(text, encoding="utf-8")
    files = _files(path.parent)
    assert "HAS_STATUS          => true" in files["turtle_system_node.vhd"]
    assert "network_other_endpoints_count" in files["turtle_system.vhd"]
    # With a host instead, there is no network.
    assert "network_" not in _files(path.parent, interconnect="axi_stream")["turtle_system.vhd"]


def test_the_faults_of_the_network_are_told_in_the_same_words() -> None:
    """In the table of the page, and at the port of the core."""
    addresses = {
        item.name: item.address for item in status_map("board", 1, 1, features=Features(Part.NETWORK)).registers
    }
    page = (REPOSITORY / "docs" / "reference" / "status.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| 0x(\w+) \| `(network_\w+)` \| (.+) \|$", page, re.MULTILINE)
    assert [(int(address, 16), name, meaning) for address, name, meaning in rows] == [
        (addresses[name], name, meaning) for name, meaning in network_words().items()
    ]
    core = (REPOSITORY / "cores" / "net" / "rtl" / "firm_net_link.vhd").read_text(encoding="ascii")
    told = re.findall(r"^ +-- +(\d+)  (.+)$", core, re.MULTILINE)
    assert told == [(str(bit), meaning) for bit, meaning in enumerate(network_words().values())]


_RGMII = """\
description: a PHY with RGMII
flow: {flow}
clock: 125 MHz
interconnect: ethernet
phy: rgmii
pins:
  - {{port: clk, site: A1}}
  - {{port: rgmii_rx_clk, site: B1}}
  - {{port: rgmii_rx_ctl, site: B2}}
  - {{port: rgmii_tx_clk, site: C1}}
  - {{port: rgmii_tx_ctl, site: C2}}
"""


def _board(folder: Path, flow: str) -> str:
    bits = "".join(f"  - {{port: 'rgmii_{way}[{bit}]', site: D{bit}}}\n" for way in ("rxd", "txd") for bit in range(4))
    (folder / "rgmii.yaml").write_text(_RGMII.format(flow=flow) + bits, encoding="utf-8")
    return "rgmii.yaml"


def test_the_clocks_of_a_phy_are_constrained(path: Path) -> None:
    files = _files(path.parent, board=_board(path.parent, "trellis"))
    clocks = [line for line in files["rgmii.lpf"].splitlines() if line.startswith("FREQUENCY")]
    assert clocks == [f'FREQUENCY PORT "{port}" 125 MHZ;' for port in ("clk", "rgmii_rx_clk")]
    assert read_board("rgmii.yaml", path.parent).ddr_flag == "ddr_ecp5"
    assert read_board("ulx3s_lan8720").ddr_flag is None


def test_pins_with_both_edges_need_cells(path: Path) -> None:
    with pytest.raises(InputError, match=r"boards with flow 'icestorm' have no cells for phy 'rgmii'"):
        _files(path.parent, board=_board(path.parent, "icestorm"))


def test_a_topic_may_be_too_long_for_the_hardware(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The topic is rt, the namespace, / and the block's name."""
    text = path.read_text(encoding="utf-8").replace("/lab", f"/{'n' * 149}")
    for length, code in ((98, 0), (99, 1)):
        path.write_text(text.replace("name: turn,", f"name: {'t' * length},"), encoding="utf-8")
        assert main(["system", "check", str(path)]) == code
    assert "of 'turtle' has 252 characters in ROS 2's network" in capsys.readouterr().err


def test_it_is_not_simulated_with_a_host(path: Path) -> None:
    with pytest.raises(InputError, match="has no host to simulate"):
        _files(path.parent, product="live", simulator="ghdl")


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ([], "a simulated board with interconnect 'ethernet' needs a network"),
        (["--network", "missing0"], "there is no network device 'missing0'"),
        (["--network", "lo"], "cannot open the network device 'lo'"),
        (["--network", "lo", "--ros", "1"], "'--ros 1' is not possible with interconnect 'ethernet'"),
        (["--network", "lo", "--trace", "ways.csv"], "'--trace' is not possible with interconnect 'ethernet'"),
    ],
)
def test_its_simulated_board_needs_a_device(
    path: Path, capsys: pytest.CaptureFixture[str], options: list[str], fault: str
) -> None:
    assert main(["live", str(path), *options]) == 1
    assert fault in capsys.readouterr().err


def test_other_systems_have_no_network(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = path.read_text(encoding="utf-8").replace("interconnect: ethernet", "interconnect: axi_stream")
    path.write_text(text, encoding="utf-8")
    assert main(["live", str(path), "--network", "tap0"]) == 1
    assert "'--network' is not possible with interconnect 'axi_stream'" in capsys.readouterr().err
