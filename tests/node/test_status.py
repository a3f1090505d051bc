"""`firm status`, and the node's check of the digest, on a simulated system and on transports of a test."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.node.reopening import checked
from fusesoc_firm.node.status.status import access, read_status, read_word, status_text, write_word
from fusesoc_firm.node.transport.built_simulator import CoreSources, build_simulator
from fusesoc_firm.node.transport.simulator import Simulator, SimulatorTransport
from fusesoc_firm.node.transport.status_registers import open_registers
from fusesoc_firm.node.transport.transport import Burst, TransportError
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.status_frames import answered, read_request, status_answer
from fusesoc_firm.system.system_core import identity
from tests.hdl.ghdl import REPOSITORY

SPECS = REPOSITORY / "specs" / "quat2euler"
QUATERNION = bytes(24) + bytes.fromhex("000000000000f03f")


def specification(folder: Path, name: str = "quat2euler") -> Path:
    """A specification with a status, beside its sources."""
    path = folder / f"{name}.yaml"
    text = (SPECS / "quat2euler.yaml").read_text()
    path.write_text(text.replace("  name: quat2euler\n", f"  name: {name}\n  status: frames\n", 1))
    if not (folder / "rtl").exists():
        (folder / "rtl").symlink_to(SPECS / "rtl")
    return path


@pytest.mark.check
def test_the_status_of_a_simulated_system_is_what_was_sent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = specification(tmp_path)
    sources = CoreSources(depend=("robot:acc:firm_cordic", "robot:acc:firm_float64"))
    built = build_simulator(spec, build_root=tmp_path / "build", sources=sources)
    with SimulatorTransport(lambda: Simulator(built.command(seed=3, stall_percent=25), built.folder)) as transport:
        for frame in (pack_frame(0, QUATERNION), pack_frame(0, QUATERNION[1:]), pack_frame(9, b"x")) * 2:
            transport.send(frame)
        assert len([transport.receive(10) for _ in range(2)]) == 2
        write_word(transport, 0x0C, 0b0010)
        status = read_status(transport)
    words = {name: word for name, word in status.words.items() if word and "wait" not in name and "digest" not in name}
    assert words.pop("subscriber[0].signature") and words.pop("publisher[0].signature")
    assert words == {
        "magic": 0x4D524946,
        "shape": 0x01001001,
        "control": 1,
        "interrupt": 0b0001,
        "last_fault": 1,
        "id_errors": 2,
        "subscriber[0].faults[0]": 2,
        "subscriber[0].frames": 4,
        "publisher[0].frames": 2,
    }
    assert status.digest == identity(load_beside(spec, [], None)).digest
    assert "2 of code 1" in status_text(status)
    script = built.script()
    assert main(["status", f"pipe:{script}", "--system", str(spec)]) == 0
    assert re.search(r"QuaternionToEuler_sub +\w{8} +0 +0 cycles  none", capsys.readouterr().out)
    assert main(["status", f"pipe:{script}", "--system", str(specification(tmp_path, "other"))]) == 1
    assert "the hardware is not that of 'other'" in capsys.readouterr().err


class Hardware:
    """A transport whose hardware answers each request with a word of a table, after a message and another answer."""

    def __init__(self, words: dict[int, int]) -> None:
        self.words = words
        self.bursts: deque[Burst] = deque()
        self.is_closed = False

    def send(self, frame: bytes) -> None:
        request = answered(frame)
        assert request
        self.bursts += [Burst(pack_frame(0, b"another")), Burst(status_answer(request[0] ^ 4, 0xBAD))]
        if request[0] in self.words:
            self.bursts.append(Burst(status_answer(request[0], self.words[request[0]])))

    def receive(self, timeout: float | None = None) -> Burst | None:
        return self.bursts.popleft() if self.bursts else None

    def is_ready(self) -> bool:
        return True

    def is_at_rest(self) -> bool:
        return True

    def close(self) -> None:
        self.is_closed = True

    def __enter__(self) -> Hardware:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Listener:
    def taken(self, first_cycle: int, last_cycle: int) -> None:
        raise AssertionError

    def refused(self, converter: int | None, code: int = 0) -> None:
        raise AssertionError

    def wants_waits(self) -> bool:
        return False

    def waited(self, first: int, cycle: int, counts: Sequence[int]) -> None:
        raise AssertionError


DESCRIPTION = NodeDescription("robot", 8, (), (), (), digest="00000003000000020000000100000000")
DIGEST = {0x30: 0, 0x34: 1, 0x38: 2, 0x3C: 3}


def test_a_node_takes_hardware_with_its_digest() -> None:
    hardware = Hardware(DIGEST)
    assert checked(lambda _: hardware, DESCRIPTION)(Listener()) is hardware
    assert not hardware.is_closed


def test_a_node_refuses_other_hardware_in_a_sentence() -> None:
    hardware = Hardware(DIGEST)
    other = replace(DESCRIPTION, digest="f" * 32)
    with pytest.raises(TransportError, match=r"the hardware is not that of 'robot': its digest is 0{7}3"):
        checked(lambda _: hardware, other)(Listener())
    assert hardware.is_closed


def test_hardware_without_a_status_is_reported() -> None:
    with pytest.raises(TransportError, match="did not answer: it has no status"):
        access(Hardware({}), read_request(0))
    with pytest.raises(TransportError, match="another kind of status"):
        read_status(Hardware({0: 7, 4: 0}))


def test_hardware_that_sends_without_end_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fusesoc_firm.node.status.status._ANSWER_SECONDS", 0.05)
    hardware = Hardware({})
    monkeypatch.setattr(hardware, "receive", lambda _: Burst(pack_frame(0, b"another")))
    with pytest.raises(TransportError, match="did not answer"):
        access(hardware, read_request(0))


def test_a_status_with_faults_is_text() -> None:
    words = {0: 0x4D524946, 4: 0x01001001, 0x14: 0x12, **DIGEST}
    words |= {address: 0 for address in range(8, 0x40, 4) if address not in words}
    words |= {0x8000 + 4 * number: number for number in range(32)}
    text = status_text(read_status(Hardware(words)), ["left", "right"])
    assert "last fault: code 2 of right" in text
    assert "left   00000000         13      14 cycles  1 of code 1, 2 of code 2" in text
    assert "code 1: the length is not that of the message\n" in text


def test_a_status_with_axi_lite_is_read_at_a_uio_device(tmp_path: Path) -> None:
    """Files instead of the device."""
    words = {0: 0x4D524946, 4: 0x01001001, 0x18: 5, **DIGEST}
    maps = tmp_path / "sys/class/uio/uio7/maps/map0"
    maps.mkdir(parents=True)
    (maps / "size").write_text("0x10000\n")
    (tmp_path / "dev").mkdir()
    device = tmp_path / "dev" / "uio7"
    device.write_bytes(b"".join(words.get(address, 0).to_bytes(4, "little") for address in range(0, 2**16, 4)))
    with open_registers("/dev/uio7", tmp_path) as transport:
        status = read_status(transport)
        assert (status.words["id_errors"], status.digest) == (5, DESCRIPTION.digest)
        write_word(transport, 0x10, 3)
        assert read_word(transport, 0x10) == 3
        with pytest.raises(TransportError, match="no register at 0x10000"):
            read_word(transport, 2**16)
    assert int.from_bytes(device.read_bytes()[0x10:0x14], "little") == 3
    (maps / "size").write_text("0x1000\n")
    with pytest.raises(TransportError, match="/dev/uio7 has a map of 4096 bytes; a status has 65536"):
        open_registers("/dev/uio7", tmp_path)


def test_a_missing_uio_device_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["status", "axi:/dev/uio_that_is_missing"]) == 1
    assert "cannot use the status at /dev/uio_that_is_missing" in capsys.readouterr().err
