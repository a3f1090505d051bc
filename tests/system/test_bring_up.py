"""The files that bring up a board under Linux, read back by dtc's programs, and the script in a folder like Linux's."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.system.boards.overlay import BUFFER_NAME, DMA_NAME, STATUS_NAME

SPECS = Path(__file__).parents[2] / "specs"
BOARDS = ("zynq7000", "zcu104", "kr260")
# A board's own tree, as far as the overlays refer to it.
BASE = """\
/dts-v1/;
/ {{
	#address-cells = <{cells}>;
	#size-cells = <{cells}>;
	{interrupts}: controller {{ interrupt-controller; #interrupt-cells = <3>; #address-cells = <0>; }};
	{clocks}: clocks {{ #clock-cells = <1>; }};
	fpga_full: fpga-full {{
		compatible = "fpga-region";
		#address-cells = <{cells}>;
		#size-cells = <{cells}>;
		ranges;
	}};
}};
"""
LABELS = {
    "zynq7000": {"cells": 1, "interrupts": "intc", "clocks": "clkc"},
    "zcu104": {"cells": 2, "interrupts": "gic", "clocks": "zynqmp_clk"},
}
# Of clock 0, and of the interrupt of S2MM: UG585, UG1085 and the bindings of Linux.
NUMBERS = {"zynq7000": (15, 30), "zcu104": (71, 90)}
LABELS["kr260"], NUMBERS["kr260"] = LABELS["zcu104"], NUMBERS["zcu104"]

needs_dtc = pytest.mark.skipif(not shutil.which("fdtoverlay"), reason="device-tree-compiler is not installed")


def made(folder: Path, board: str, *options: str, spec: Path = SPECS / "quat2euler/quat2euler.yaml") -> Path:
    """Write the files; return the path of the overlay."""
    assert main(["system", "bring-up", str(spec), "--board", board, "-o", str(folder), *options]) == 0
    (overlay,) = [path for path in folder.glob("*.dtso") if not path.stem.endswith("_memory")]
    return overlay


def compiled(source: Path) -> Path:
    """Compile a tree, of which dtc has nothing to say."""
    binary = source.with_suffix(".dtbo")
    options = ["-W", "no-avoid_unnecessary_addr_size"] if source.stem.endswith("_memory") else []
    done = subprocess.run(["dtc", "-@", *options, "-o", binary, source], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return binary


class Tree:
    """A board's tree with overlays, as fdtoverlay merges them."""

    def __init__(self, folder: Path, board: str, *overlays: Path) -> None:
        base = folder / "base.dts"
        base.write_text(BASE.format(**LABELS[board]), encoding="ascii")
        self._path = folder / "merged.dtb"
        binary = folder / "base.dtb"
        subprocess.run(["dtc", "-q", "-@", "-o", binary, base], check=True)
        subprocess.run(
            ["fdtoverlay", "-i", binary, "-o", self._path, *map(compiled, overlays)], check=True, capture_output=True
        )

    def numbers(self, node: str, name: str) -> list[int]:
        return [int(word) for word in self._get("-t", "u", node, name)]

    def text(self, node: str, name: str) -> str:
        return " ".join(self._get(node, name))

    def _get(self, *words: str) -> list[str]:
        options, rest = (words[:2], words[2:]) if words[0] == "-t" else ((), words)
        done = subprocess.run(["fdtget", *options, self._path, *rest], capture_output=True, text=True, check=True)
        return done.stdout.split()


def wide(value: int, cells: int) -> list[int]:
    return [0] * (cells - 1) + [value]


@needs_dtc
@pytest.mark.parametrize("board", BOARDS)
def test_linux_gets_what_the_block_design_has(tmp_path: Path, board: str) -> None:
    """Two trees of independent programs: the addresses are those of the block design's script."""
    tree = Tree(tmp_path, board, made(tmp_path, board))
    base = 0x40400000 if board == "zynq7000" else 0xA0000000
    clock, interrupt = NUMBERS[board]
    cells = int(str(LABELS[board]["cells"]))
    device = f"/fpga-full/{DMA_NAME}@{base:x}"
    assert tree.text("/fpga-full", "firmware-name") == f"quat2euler_{board}.bit.bin"
    assert tree.text(device, "compatible") == "generic-uio"
    assert tree.text(device, "linux,uio-name") == DMA_NAME
    assert tree.numbers(device, "reg") == [*wide(base, cells), *wide(0x10000, cells)]
    assert tree.numbers(device, "interrupts") == [0, interrupt, 4]
    assert tree.numbers(device, "interrupt-parent") == tree.numbers("/controller", "phandle")
    assert tree.numbers("/fpga-full/firm-clock-0", "assigned-clock-rates") == [100_000_000]
    assert tree.numbers("/fpga-full/firm-clock-0", "clocks") == [*tree.numbers("/clocks", "phandle"), clock]
    assert tree.text(f"/{BUFFER_NAME}", "compatible") == "ikwzm,u-dma-buf"
    assert tree.text(f"/{BUFFER_NAME}", "device-name") == BUFFER_NAME
    assert tree.numbers(f"/{BUFFER_NAME}", "size") == [16 * 2**20]


@needs_dtc
@pytest.mark.parametrize("board", BOARDS)
def test_memory_is_reserved_on_request(tmp_path: Path, board: str) -> None:
    overlay = made(tmp_path, board, "--reserve", "--memory", "64")
    tree = Tree(tmp_path, board, overlay, overlay.with_name(f"{overlay.stem}_memory.dtso"))
    cells = int(str(LABELS[board]["cells"]))
    memory = "/reserved-memory/firm-memory"
    assert tree.text(memory, "compatible") == "shared-dma-pool"
    assert tree.numbers(memory, "size") == wide(64 * 2**20, cells)
    start_and_size = tree.numbers(memory, "alloc-ranges")
    assert start_and_size[cells - 1] + start_and_size[-1] <= 2**32
    assert tree.numbers("/reserved-memory", "#size-cells") == [cells]
    assert tree.numbers(f"/{BUFFER_NAME}", "memory-region") == tree.numbers(memory, "phandle")
    assert BUFFER_NAME not in overlay.read_text(encoding="ascii")


@needs_dtc
def test_further_clocks_and_the_status_have_nodes(tmp_path: Path) -> None:
    text = (SPECS / "quat2euler/quat2euler.yaml").read_text(encoding="utf-8")
    spec = tmp_path / "quat2euler.yaml"
    keys = "project:\n  status: axi_lite\n  clocks: [{name: quick, frequency: 150 MHz}]\n"
    text = text.replace("project:\n", keys, 1)
    text = text.replace("    type: quat2euler\n", "    type: quat2euler\n    clock: quick\n")
    spec.write_text(text, encoding="utf-8")
    tree = Tree(tmp_path, "zcu104", made(tmp_path, "zcu104", spec=spec))
    assert tree.numbers("/fpga-full/firm-clock-1", "assigned-clock-rates") == [150_000_000]
    assert tree.numbers("/fpga-full/firm-clock-1", "clocks")[1] == 72
    status = f"/fpga-full/{STATUS_NAME}@a0010000"
    assert tree.numbers(status, "reg") == [0, 0xA0010000, 0, 0x10000]
    assert tree.numbers(status, "interrupts") == [0, 91, 4]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--board", "ulx3s"), "board 'ulx3s' has no processor that runs Linux"),
        (("--board", "zcu105"), "unknown board 'zcu105'"),
        (("--board", "zcu104", "--memory", "513"), "the shared memory has 513 MiB; legal: 1 to 512"),
    ],
)
def test_what_has_no_files(
    tmp_path: Path, options: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = str(SPECS / "quat2euler/quat2euler.yaml")
    assert main(["system", "bring-up", spec, "-o", str(tmp_path), *options]) == 1
    assert message in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


class Board:
    """A folder like Linux's, in which stand-ins for `modprobe` and `mkdir` do what the kernel would."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "root"
        self.files = folder / "files"
        self.overlay = self.root / "sys/kernel/config/device-tree/overlays/quat2euler_zynq7000"
        self.overlay.parent.mkdir(parents=True)
        (self.root / "dev").mkdir()
        made(self.files, "zynq7000")
        (self.files / "quat2euler_zynq7000.bit.bin").write_bytes(b"a bitstream")
        (self.files / "quat2euler_zynq7000.dtbo").write_bytes(b"an overlay")
        self.programs = folder / "programs"
        self.programs.mkdir()
        self.log = folder / "log"
        self.program("modprobe", f'echo "$@" >>"{self.log}"')
        uio = self.root / "sys/class/uio/uio3"
        self.kernel = f"""\
/bin/mkdir "$@"
case "$*" in *overlays*)
  echo applied >"{self.overlay}/status"
  /bin/mkdir -p "{uio}"; echo {DMA_NAME} >"{uio}/name"; : >"{self.root}/dev/{BUFFER_NAME}";;
esac"""
        self.program("mkdir", self.kernel)
        # The kernel removes an overlay's files with its folder.
        self.program("rmdir", '/bin/rm -r "$1"')
        self.program("sleep", ":")

    def program(self, name: str, text: str) -> None:
        path = self.programs / name
        path.write_text(f"#!/bin/sh\n{text}\n", encoding="ascii")
        path.chmod(0o755)

    def run(self, *words: str) -> tuple[int, str, str]:
        environment = {"PATH": f"{self.programs}:{os.environ['PATH']}", "ROOT": str(self.root)}
        script = str(self.files / "quat2euler_zynq7000.sh")
        done = subprocess.run(["sh", script, *words], env=environment, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr


def test_the_script_loads_and_removes(tmp_path: Path) -> None:
    board = Board(tmp_path)
    assert board.run("status") == (1, "", "quat2euler_zynq7000: is not loaded\n")
    assert board.run("load") == (0, f"dma:/dev/uio3:{BUFFER_NAME}\n", "")
    assert (board.root / "lib/firmware/quat2euler_zynq7000.bit.bin").read_bytes() == b"a bitstream"
    assert (board.overlay / "dtbo").read_bytes() == b"an overlay"
    assert board.log.read_text().splitlines() == ["uio_pdrv_genirq of_id=generic-uio", "u-dma-buf"]
    assert board.run("status") == (0, f"dma:/dev/uio3:{BUFFER_NAME}\n", "")
    assert board.run("load")[0] == 1
    assert board.run("unload") == (0, "", "")
    assert not board.overlay.exists()
    assert board.run("unload")[0] == 1
    assert board.run()[0] == board.run("start")[0] == 2


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (lambda board: (board.files / "quat2euler_zynq7000.bit.bin").unlink(), "bootgen makes it"),
        (lambda board: board.program("modprobe", '[ "$1" != u-dma-buf ]'), "the driver u-dma-buf is missing"),
        (lambda board: shutil.rmtree(board.root / "sys/kernel/config"), "no configfs"),
        (lambda board: board.program("mkdir", '/bin/mkdir "$@"'), "Linux refused the overlay or the bitstream"),
        (
            lambda board: board.program("mkdir", board.kernel.replace(f"echo {DMA_NAME}", "echo other")),
            "its devices are missing",
        ),
    ],
)
def test_the_script_names_what_is_missing(tmp_path: Path, harm: object, message: str) -> None:
    board = Board(tmp_path)
    assert callable(harm)
    harm(board)
    status, printed, error = board.run("load")
    assert (status, printed) == (1, "") and message in error
    assert re.fullmatch(r"quat2euler_zynq7000: .*\n", error)
