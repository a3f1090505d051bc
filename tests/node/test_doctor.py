"""`firm doctor` in folders like those of a board under Linux."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.node.doctor import Finding, examine, transport_address
from fusesoc_firm.system.boards.overlay import BUFFER_NAME, DMA_NAME

Change = Callable[[Path], object]


def put(root: Path, path: str, text: str = "") -> None:
    place = root / path
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(text, encoding="ascii")


# What a board gets, in the order in which the command asks for it.
STEPS: list[tuple[str, Change]] = [
    (
        "processor",
        lambda root: put(root, "sys/firmware/devicetree/base/compatible", "xlnx,zynqmp-kr260\0xlnx,zynqmp\0"),
    ),
    ("loading bitstreams", lambda root: put(root, "sys/class/fpga_manager/fpga0/state", "unknown\n")),
    ("overlays", lambda root: (root / "sys/kernel/config/device-tree/overlays").mkdir(parents=True)),
    ("device tree", lambda root: put(root, f"sys/firmware/devicetree/base/fpga-full/{DMA_NAME}@a0000000/reg")),
    ("bitstream", lambda root: put(root, "sys/class/fpga_manager/fpga0/state", "operating\n")),
    ("registers", lambda root: put(root, "sys/class/uio/uio1/name", DMA_NAME)),
    ("interrupt", lambda root: put(root, "proc/interrupts", f" 48:  0  0  GICv2 122 Level  {DMA_NAME}\n")),
    ("access to the registers", lambda root: put(root, "dev/uio1")),
    ("shared memory", lambda root: put(root, f"sys/class/u-dma-buf/{BUFFER_NAME}/size", "16777216\n")),
    ("place of the memory", lambda root: put(root, f"sys/class/u-dma-buf/{BUFFER_NAME}/phys_addr", "0x70000000\n")),
    ("access to the memory", lambda root: put(root, f"dev/{BUFFER_NAME}")),
    ("access to the memory", lambda root: put(root, f"sys/class/u-dma-buf/{BUFFER_NAME}/sync_mode", "0\n")),
]


def board(root: Path) -> Path:
    for _, step in STEPS:
        step(root)
    return root


def faults(root: Path) -> dict[str, Finding]:
    return {finding.subject: finding for finding in examine(root) if finding.fault}


def test_mended_in_order_it_works(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The first fault is always the next step, and nothing before it is in doubt."""
    put(tmp_path, "sys/class/uio/uio0/name", "another")
    for subject, step in STEPS:
        findings = examine(tmp_path)
        first = next(finding for finding in findings if not finding.is_in_order)
        assert (first.subject, first.is_known) == (subject, True) and first.remedy
        assert main_status(tmp_path) == 1
        assert f"\n1. {subject}: {first.remedy}\n" in capsys.readouterr().out
        step(tmp_path)
    assert not faults(tmp_path)
    assert transport_address(tmp_path) == f"dma:/dev/uio1:{BUFFER_NAME}"
    assert main(["doctor", "--root", str(tmp_path)]) == 0
    assert f"the node's transport: dma:/dev/uio1:{BUFFER_NAME}\n" in capsys.readouterr().out


def main_status(root: Path) -> int:
    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--root", str(root)])
    return int(str(ended.value.code))


@pytest.mark.parametrize(
    ("change", "subject", "words"),
    [
        (
            lambda root: put(root, "sys/firmware/devicetree/base/compatible", "raspberrypi,5\0"),
            "processor",
            "raspberrypi,5",
        ),
        (lambda root: put(root, "sys/class/fpga_manager/fpga0/state", "write error\n"), "bitstream", "'write error'"),
        (lambda root: put(root, "sys/class/uio/uio1/name", "dma"), "registers", DMA_NAME),
        (lambda root: put(root, "proc/interrupts", " 48: 0 0 GICv2 122 Level eth0\n"), "interrupt", DMA_NAME),
        (lambda root: (root / "dev/uio1").unlink(), "access to the registers", "/dev/uio1"),
        (lambda root: shutil.rmtree(root / "sys/class/u-dma-buf"), "shared memory", BUFFER_NAME),
        (
            lambda root: put(root, f"sys/class/u-dma-buf/{BUFFER_NAME}/phys_addr", "0x7fffff20\n"),
            "place of the memory",
            "0x7fffff20",
        ),
        (
            lambda root: put(root, f"sys/class/u-dma-buf/{BUFFER_NAME}/phys_addr", "0xff800000\n"),
            "place of the memory",
            "below 4 GiB",
        ),
        (lambda root: put(root, f"sys/class/u-dma-buf/{BUFFER_NAME}/size", "many"), "place of the memory", "'many'"),
        (lambda root: (root / f"dev/{BUFFER_NAME}").unlink(), "access to the memory", f"/dev/{BUFFER_NAME}"),
    ],
)
def test_one_fault_is_named_alone(tmp_path: Path, change: Change, subject: str, words: str) -> None:
    change(board(tmp_path))
    found = faults(tmp_path)
    assert [*found] == [subject]
    assert words in found[subject].fault


def test_a_tree_that_the_boot_loader_loads_needs_no_overlays(tmp_path: Path) -> None:
    shutil.rmtree(board(tmp_path) / "sys/kernel/config")
    assert not faults(tmp_path)


def test_older_u_dma_buf(tmp_path: Path) -> None:
    (board(tmp_path) / "sys/class/u-dma-buf").rename(tmp_path / "sys/class/udmabuf")
    assert not faults(tmp_path)


def test_here_is_no_board(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--root", str(tmp_path / "none")]) == 1
    assert "there is no folder" in capsys.readouterr().err
