"""Find missing requirements of a node with AXI DMA on a board under Linux, in the order of repair.

    for finding in examine(Path("/")):
        print(finding.subject, finding.fault or "in order", finding.remedy)

Only files are read; no register is accessed, since an access to logic without a clock can stop the processor.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.node.transport.dma_device import DMA_ALIGNMENT, DMA_REACH
from fusesoc_firm.system.boards.overlay import BUFFER_NAME, DMA_NAME

_TREE = "sys/firmware/devicetree/base"
_OVERLAYS = "sys/kernel/config/device-tree/overlays"
_PROCESSORS = ("xlnx,zynq-7000", "xlnx,zynqmp")
_LOAD = "sh <system>_<board>.sh load"
# u-dma-buf's class, and that of older releases.
_BUFFER_CLASSES = ("u-dma-buf", "udmabuf")


@dataclass(frozen=True)
class Finding:
    """The state of a subject: in order without a fault; unknown if an earlier fault prevents an examination."""

    subject: str
    fault: str = ""
    remedy: str = ""
    is_known: bool = True

    @property
    def is_in_order(self) -> bool:
        """Whether the subject was examined and has no fault."""
        return self.is_known and not self.fault


class _FaultError(Exception):
    """A fault, and its remedy."""

    def __init__(self, fault: str, remedy: str) -> None:
        super().__init__(fault)
        self.fault = fault
        self.remedy = remedy


def is_board(root: Path) -> bool:
    """Return whether the machine has a device tree, like all boards with a processor beside the FPGA."""
    return (root / _TREE).is_dir()


def examine(root: Path = Path("/")) -> list[Finding]:
    """Return the state of each subject; all paths begin with `root`."""
    findings: dict[str, Finding] = {}
    for subject, needs, check in _CHECKS:
        if not all(findings[need].is_in_order for need in needs):
            findings[subject] = Finding(subject, is_known=False)
            continue
        try:
            check(root)
            findings[subject] = Finding(subject)
        except _FaultError as found:
            findings[subject] = Finding(subject, found.fault, found.remedy)
    return [*findings.values()]


def transport_address(root: Path = Path("/")) -> str:
    """Return the address of the transport on a board in order."""
    return f"dma:/dev/{_uio(root).name}:{BUFFER_NAME}"


def _check_processor(root: Path) -> None:
    found = _text(root / _TREE / "compatible").split("\0")
    if not {*found} & {*_PROCESSORS}:
        names = ", ".join(filter(None, found)) or "unknown"
        raise _FaultError(f"the processor is not a Zynq, but {names}", "run this command on the board")


def _check_manager(root: Path) -> None:
    if not _entries(root / "sys/class/fpga_manager"):
        raise _FaultError(
            "the kernel cannot load bitstreams",
            "use a kernel with CONFIG_FPGA_MGR_ZYNQ_FPGA (Zynq-7000) or CONFIG_FPGA_MGR_ZYNQMP_FPGA, and"
            " CONFIG_FPGA_REGION",
        )


def _check_overlays(root: Path) -> None:
    if not (root / _OVERLAYS).is_dir() and not _nodes(root):
        raise _FaultError(
            "the kernel takes no overlays at run time",
            "mount -t configfs none /sys/kernel/config; if that does not help, use a kernel with CONFIG_OF_CONFIGFS",
        )


def _check_tree(root: Path) -> None:
    if not _nodes(root):
        raise _FaultError(f"the device tree has no {DMA_NAME}", _LOAD)


def _check_bitstream(root: Path) -> None:
    states = [_text(manager / "state") for manager in _entries(root / "sys/class/fpga_manager")]
    if "operating" not in states:
        raise _FaultError(f"the FPGA is in the state '{states[0]}', not 'operating'", _LOAD)


def _check_uio(root: Path) -> None:
    try:
        _uio(root)
    except StopIteration:
        raise _FaultError(
            f"no UIO device is called {DMA_NAME}",
            "modprobe uio_pdrv_genirq of_id=generic-uio; if the driver is part of the kernel, add"
            " uio_pdrv_genirq.of_id=generic-uio to the kernel's command line",
        ) from None


def _check_interrupt(root: Path) -> None:
    if DMA_NAME not in _text(root / "proc/interrupts").split():
        raise _FaultError(
            f"Linux has no interrupt of {DMA_NAME}",
            "write the overlay again with 'firm system bring-up' for this board; until then, add ':poll' to the"
            " transport's address",
        )


def _check_uio_access(root: Path) -> None:
    _check_access(root / "dev" / _uio(root).name)


def _check_buffer(root: Path) -> None:
    if _buffer(root) is None:
        raise _FaultError(
            f"u-dma-buf has no memory called {BUFFER_NAME}",
            "modprobe u-dma-buf; if 'dmesg' says that it found no memory, add cma=64M to the kernel's command line, or"
            " reserve memory with 'firm system bring-up --reserve'",
        )


def _check_place(root: Path) -> None:
    about = _buffer(root)
    assert about is not None
    address, size = (_number(about / name) for name in ("phys_addr", "size"))
    if address % DMA_ALIGNMENT or address + size > DMA_REACH:
        raise _FaultError(
            f"the memory is at {address:#x} and has {size:#x} bytes; legal: multiples of {DMA_ALIGNMENT}, below 4 GiB",
            "reserve memory with 'firm system bring-up --reserve'",
        )


def _check_buffer_access(root: Path) -> None:
    about = _buffer(root)
    assert about is not None
    _check_access(root / "dev" / BUFFER_NAME)
    _check_access(about / "sync_mode")


_CHECKS: Sequence[tuple[str, tuple[str, ...], Callable[[Path], None]]] = (
    ("processor", (), _check_processor),
    ("loading bitstreams", ("processor",), _check_manager),
    ("overlays", ("processor",), _check_overlays),
    ("device tree", ("overlays",), _check_tree),
    ("bitstream", ("loading bitstreams", "device tree"), _check_bitstream),
    ("registers", ("device tree",), _check_uio),
    ("interrupt", ("registers",), _check_interrupt),
    ("access to the registers", ("registers",), _check_uio_access),
    ("shared memory", ("device tree",), _check_buffer),
    ("place of the memory", ("shared memory",), _check_place),
    ("access to the memory", ("shared memory",), _check_buffer_access),
)


def _check_access(path: Path) -> None:
    if not path.exists():
        raise _FaultError(f"{'/dev/' if path.parent.name == 'dev' else ''}{path.name} is missing", _LOAD)
    if not os.access(path, os.R_OK | os.W_OK):
        raise _FaultError(
            f"this user may not read and write {path.name}", "run the node as root, or add a udev rule for the device"
        )


def _nodes(root: Path) -> list[Path]:
    return [*(root / _TREE).rglob(f"{DMA_NAME}@*")]


def _uio(root: Path) -> Path:
    """Return the folder of the UIO device. Raise StopIteration if it is missing."""
    return next(path for path in _entries(root / "sys/class/uio") if _text(path / "name") == DMA_NAME)


def _buffer(root: Path) -> Path | None:
    folders = [root / "sys/class" / kind / BUFFER_NAME for kind in _BUFFER_CLASSES]
    return next((folder for folder in folders if folder.is_dir()), None)


def _entries(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _number(path: Path) -> int:
    text = _text(path)
    try:
        return int(text, 0)
    except ValueError:
        raise _FaultError(
            f"{path.name} of {BUFFER_NAME} is '{text}', not a number", "use a newer release of u-dma-buf"
        ) from None


def _text(path: Path) -> str:
    """Return a file's text without white space at the end, or "" if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
