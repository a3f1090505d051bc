"""Nodes in Python and C++ whose hardware has a status with AXI4-Lite: files instead of the UIO device.

A namespace of its own gives each node the files of /sys.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest

from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.node.node import HardwareListener
from fusesoc_firm.node.reopening import checked, status_registers
from fusesoc_firm.node.status.status import read_status, read_word, write_word
from fusesoc_firm.node.status.status_socket import open_status
from fusesoc_firm.node.transport.status_registers import open_registers_at
from fusesoc_firm.node.transport.transport import Transport, TransportError
from tests.hdl.ghdl import REPOSITORY
from tests.node.drivers import cpp_driver
from tests.node.fake_node import FakeHardware, echo

DIGEST = "00000003000000020000000100000000"
WORDS = {0: 0x4D524946, 4: 0x01001001, 0x18: 5, 0x30: 0, 0x34: 1, 0x38: 2, 0x3C: 3}
SIMULATOR = f"pipe:exec {sys.executable} -m tests.node.model_simulator"
DESCRIPTION = NodeDescription("robot", 8, (), (), (), digest=DIGEST, has_status_registers=True)
IS_NAMESPACE_ALLOWED = subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode == 0


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """The files of a board with the status at /dev/uio7."""
    maps = tmp_path / "sys/class/uio/uio7/maps/map0"
    maps.mkdir(parents=True)
    (maps / "size").write_text("0x10000\n")
    (maps.parents[1] / "name").write_text("firm-status\n")
    (tmp_path / "dev").mkdir()
    write(tmp_path, WORDS)
    return tmp_path


def write(root: Path, words: dict[int, int]) -> None:
    content = b"".join(words.get(address, 0).to_bytes(4, "little") for address in range(0, 2**16, 4))
    (root / "dev/uio7").write_bytes(content)


def test_the_overlay_names_the_device(root: Path) -> None:
    status = read_status(open_registers_at("", root))
    assert (status.words["id_errors"], status.digest) == (5, DIGEST)
    (root / "sys/class/uio/uio7/name").write_text("another\n")
    with pytest.raises(TransportError, match="no UIO device is called firm-status; '--status axi:UIO' names the"):
        open_registers_at("", root)
    with pytest.raises(TransportError, match="the status is 'uart:/dev/x'; legal: axi:UIO"):
        open_registers_at("uart:/dev/x", root)


def test_a_node_refuses_other_hardware_before_it_opens_the_transport(root: Path) -> None:
    opened = 0

    def transport(listener: HardwareListener) -> FakeHardware:
        nonlocal opened
        opened += 1
        return FakeHardware(echo, listener)

    registers = open_registers_at("axi:/dev/uio7", root)
    opener = checked(transport, DESCRIPTION, registers)
    opener(Listener())
    write(root, {**WORDS, 0x30: 9})
    with pytest.raises(TransportError, match=f"the hardware is not that of 'robot': its digest is {DIGEST[:-1]}9"):
        opener(Listener())
    assert opened == 1


class Listener:
    def taken(self, first_cycle: int, last_cycle: int) -> None: ...

    def refused(self, converter: int | None, code: int = 0) -> None: ...

    def wants_waits(self) -> bool:
        return False

    def waited(self, first: int, cycle: int, counts: Sequence[int]) -> None: ...


def test_a_simulator_has_no_registers() -> None:
    assert status_registers(DESCRIPTION, "", "pipe:exec simulator") is None
    assert status_registers(DESCRIPTION, "", "") is None
    frames = NodeDescription("robot", 8, (), (), (), digest=DIGEST)
    assert status_registers(frames, "", "dma:/dev/uio0:udmabuf0") is None
    with pytest.raises(TransportError, match="'robot' has no 'status: axi_lite', so '--status' has no effect"):
        status_registers(frames, "axi:/dev/uio7", "dma:/dev/uio0:udmabuf0")


@pytest.fixture(params=["python", "cpp"])
def node(request: pytest.FixtureRequest, tmp_path: Path) -> list[str | Path]:
    """The command that starts a node without ROS; its argument is the node's name, as all processes share sockets."""
    if request.param == "cpp":
        return [cpp_driver("program", sanitizers="").program]
    path = tmp_path / "robot_node.py"
    path.write_text(
        "import sys\n"
        "from fusesoc_firm.node.interface.description import Crossing, NodeDescription\n"
        "from fusesoc_firm.node.script import main\n"
        f"description = NodeDescription(sys.argv.pop(1), 8, (), (), ((),), (Crossing('in', 0),), digest='{DIGEST}',\n"
        "    has_status_registers=True)\n"
        "main(description)\n"
    )
    return [sys.executable, path]


@contextmanager
def started(node: Sequence[str | Path], root: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A node whose /sys has the files of `root`."""
    script = f"mount --bind '{root}/sys' /sys; exec \"$@\""
    command = ["unshare", "-rm", "sh", "-ec", script, "sh", *node, *arguments]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        try:
            yield process
        finally:
            process.kill()


needs_namespace = pytest.mark.skipif(not IS_NAMESPACE_ALLOWED, reason="namespaces of users are not permitted")


@needs_namespace
@pytest.mark.check
def test_a_node_with_other_hardware_ends(node: Sequence[str | Path], root: Path) -> None:
    write(root, {**WORDS, 0x30: 9})
    with started(node, root, "robot", "--transport", SIMULATOR, "--status", f"axi:{root}/dev/uio7") as process:
        _, text = process.communicate()
    assert f"the hardware is not that of 'robot': its digest is {DIGEST[:-1]}9, and the specification's is" in text
    assert process.returncode == 1


@needs_namespace
@pytest.mark.check
def test_a_node_on_a_board_needs_the_registers(node: Sequence[str | Path], root: Path) -> None:
    (root / "sys/class/uio/uio7/name").write_text("another\n")
    with started(node, root, "robot", "--transport", "dma:/dev/uio_that_is_missing:buffer") as process:
        _, text = process.communicate()
    assert "no UIO device is called firm-status; '--status axi:UIO' names the device of the status" in text
    assert process.returncode == 1


@needs_namespace
@pytest.mark.check
def test_a_node_is_asked_for_its_registers(node: Sequence[str | Path], root: Path) -> None:
    name = f"robot_{uuid4().hex[:8]}"
    with started(node, root, name, "--transport", SIMULATOR, "--status", f"axi:{root}/dev/uio7") as process:
        while not (transport := connected(name)):
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        with transport:
            status = read_status(transport)
            write_word(transport, 0x10, 3)
            assert read_word(transport, 0x10) == 3
        process.terminate()
        _, text = process.communicate()
    assert (status.words["id_errors"], status.digest) == (5, DIGEST)
    assert process.returncode == 0, text


def connected(name: str) -> Transport | None:
    """A transport to a node, or None as long as it has not started."""
    try:
        return open_status(f"node:{name}")
    except TransportError:
        return None
