"""A system that is a node of ROS 1 in the sockets of a chip: checked, shown, and generated."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import Request
from fusesoc_firm.fabric.ros1 import node_of
from fusesoc_firm.message.library import libraries
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.diagnostics import InputError

SPECIFICATION = """\
paths: [{paths}]
project:
  name: turtle
  clock: 12 MHz
  interconnect: w5500
  network: {{mac: "02:0A:00:00:00:02", address: 192.0.2.9, master: "http://192.0.2.1:11000/", namespace: /lab}}
blocks:
  - {{name: in, middleware: ROS, mode: subscriber, message: {message}, topic: turn{further}, outgoing: [{{name: out}}]}}
  - {{name: out, middleware: ROS, mode: publisher, message: {message}, topic: turned}}
"""
MESSAGES = {
    "Longest": "uint8[2044] bytes\n",
    "Long": "uint8[2045] bytes\n",
    "Text": "string text\n",
    "Least": "uint8[2044] bytes\nstring text\n",
}


def _specification(folder: Path, message: str, further: str = "") -> Path:
    package = folder / "messages" / "long_msgs" / "msg"
    package.mkdir(parents=True)
    for name, text in MESSAGES.items():
        (package / f"{name}.msg").write_text(text, encoding="utf-8")
    path = folder / "turtle.yaml"
    text = SPECIFICATION.format(message=f"long_msgs/{message}", further=further, paths="messages")
    path.write_text(text, encoding="utf-8")
    return path


def test_it_is_checked_and_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _specification(tmp_path, "Longest")
    assert main(["system", "check", str(path)]) == 0
    assert "bytes of memory for its program and texts" in capsys.readouterr().out
    assert main(["system", "show", str(path)]) == 0
    shown = yaml.safe_load(capsys.readouterr().out)["System"]
    assert shown["interconnect"] == "w5500"
    assert shown["network"] == {
        "mac": "02:0a:00:00:00:02",
        "address": "192.0.2.9",
        "netmask": "255.255.255.0",
        "name": "turtle",
        "namespace": "/lab",
        "master": "192.0.2.1:11000",
    }


@pytest.mark.parametrize(
    ("message", "further", "fault"),
    [
        ("Long", "", "'in' has payloads of 2045 bytes, but a buffer of the chip holds 2044"),
        ("Least", "", "'in' has payloads of 2048 bytes, but a buffer of the chip holds 2044"),
        ("Text", ", maxLength: 2045", "payloads of 'in' cannot have 2045 bytes"),
    ],
)
def test_messages_above_the_buffer_of_the_chip_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], message: str, further: str, fault: str
) -> None:
    assert main(["system", "check", str(_specification(tmp_path, message, further))]) == 1
    assert fault in capsys.readouterr().err


def test_a_message_as_long_as_the_buffer_is_possible(tmp_path: Path) -> None:
    assert main(["system", "check", str(_specification(tmp_path, "Text", ", maxLength: 2044"))]) == 0


SERVICES = """\
paths: [messages]
project:
  name: turtle
  clock: 12 MHz
  interconnect: w5500
  network:
    mac: "02:0A:00:00:00:02"
    address: 192.0.2.9
    master: robot-pc:11000
    hosts: [{name: robot-pc, address: 192.0.2.1}]
accelerators:
  - name: answering
    type: VHDL
    sources: answering.vhd
    interface:
      input: [{middleware: ROS, message: long_msgs/AskRequest}]
      output: [{middleware: ROS, message: long_msgs/AskResponse}]
blocks:
  - {name: ask, middleware: ROS, mode: server, service: long_msgs/Ask, outgoing: [{name: answer}]}
  - {name: answer, type: answering, outgoing: [{name: ask}]}
"""


def _with_service(folder: Path, answer: str = "uint8[8] answer") -> Path:
    path = _specification(folder, "Text")
    (folder / "messages" / "long_msgs" / "srv").mkdir()
    text = f"uint8[8] question\n---\n{answer}\n"
    (folder / "messages" / "long_msgs" / "srv" / "Ask.srv").write_text(text, encoding="utf-8")
    path.write_text(SERVICES, encoding="utf-8")
    (folder / "answering.vhd").touch()
    return path


def test_a_service_is_part_of_the_node(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _with_service(tmp_path)
    loaded = load_system(path, libraries([tmp_path / "messages"], None, None))
    node = node_of(loaded.system, loaded.libraries)
    assert (node.subscribers, node.publishers) == ((), ())
    (service,) = node.services
    assert (service.name, service.type, service.request, service.response) == ("/ask", "long_msgs/Ask", 0, 0)
    assert service.md5 == _md5("uint8[8] questionuint8[8] answer")
    assert main(["system", "show", str(path)]) == 0
    shown = yaml.safe_load(capsys.readouterr().out)["System"]["network"]
    assert (shown["master"], shown["hosts"]) == ("192.0.2.1:11000", {"robot-pc": "192.0.2.1"})


def _md5(text: str) -> str:
    """The sum of a service, by the rule of genmsg: both parts, one after another."""
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def test_a_response_has_one_byte_less(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["system", "check", str(_with_service(tmp_path, "uint8[2044] answer"))]) == 1
    assert "payloads of 2044 bytes, but a buffer of the chip holds 2043" in capsys.readouterr().err


def _request(folder: Path, **parameters: str) -> Request:
    known = {"spec": "turtle.yaml", "product": "system", **dict.fromkeys(("board", "paths", "distro"))}
    return Request("far", "test:sys:turtle-system:0", folder, {**known, **parameters})


def test_its_rom_comes_before_its_top_level(tmp_path: Path) -> None:
    path = _specification(tmp_path, "Longest")
    files = [*GENERATORS["far"].load(_request(path.parent)).generate().files]
    assert files.index("turtle_system_rom.vhd") < files.index("turtle_system.vhd")
    on_board = GENERATORS["far"].load(_request(path.parent, board="icebreaker_w5500")).generate().files
    assert {"turtle_icebreaker_w5500.vhd", "icebreaker_w5500.pcf"} < set(on_board)


def test_its_texts_may_exceed_the_memory(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _specification(tmp_path, "Text")
    constants = "".join(f"int32 CONSTANT_{number:09}=0\n" for number in range(1000))
    (tmp_path / "messages" / "long_msgs" / "msg" / "Text.msg").write_text(f"{constants}string text\n")
    assert main(["system", "check", str(path)]) == 1
    assert "bytes of memory for its texts" in capsys.readouterr().err


def test_it_is_not_simulated_with_a_host(tmp_path: Path) -> None:
    path = _specification(tmp_path, "Text")
    with pytest.raises(InputError, match="has no host to simulate"):
        GENERATORS["far"].load(_request(path.parent, product="live", simulator="ghdl")).generate()


def test_no_node_on_a_host_serves_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _specification(tmp_path, "Text")
    for command in (["live", str(path), "--transport", "uart:/dev/null"], ["system", "node", str(path)]):
        assert main(command) == 1
        assert "'turtle' is a node itself, and needs none on a host" in capsys.readouterr().err
