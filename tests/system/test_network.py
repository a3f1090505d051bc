"""A system that is a node of ROS 2 itself: checked and shown, but not generated yet."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.plugin.generators import GENERATORS
from fusesoc_firm.request.request import Request
from fusesoc_firm.text.diagnostics import InputError

SPECIFICATION = """\
project:
  name: turtle
  interconnect: ethernet
  network: {mac: 02:0A:00:00:00:02, address: 192.0.2.9, gateway: 192.0.2.254, namespace: /lab}
blocks:
  - {name: turn, middleware: ROS2, mode: subscriber, message: geometry_msgs/Quaternion, outgoing: [{name: turned}]}
  - {name: turned, middleware: ROS2, mode: publisher, message: geometry_msgs/Quaternion}
"""
REFUSAL = "3:17: error: interconnect 'ethernet' can be checked, but is not built yet"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "turtle.yaml"
    made.write_text(SPECIFICATION, encoding="utf-8")
    return made


def test_it_is_checked_and_shown(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["system", "check", str(path)]) == 0
    capsys.readouterr()
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
    }


def test_no_node_on_a_host_serves_it(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (["live", str(path), "--transport", "uart:/dev/null"], ["system", "node", str(path)]):
        assert main(command) == 1
        assert f"{path}:{REFUSAL}" in capsys.readouterr().err


def _request(folder: Path, **parameters: str) -> Request:
    known = {"spec": "turtle.yaml", "product": "system", **dict.fromkeys(("board", "paths", "distro"))}
    return Request("far", "test:sys:turtle-system:0", folder, {**known, **parameters})


def test_it_is_not_generated_but_with_streams(path: Path) -> None:
    with pytest.raises(InputError, match="is not built yet"):
        GENERATORS["far"].load(_request(path.parent))
    loaded = GENERATORS["far"].load(_request(path.parent, interconnect="axi_stream"))
    assert "turtle_system.vhd" in loaded.generate().files
