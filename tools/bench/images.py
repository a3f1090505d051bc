"""Accelerators for images: cycles of a full HD image, counted in simulations of their netlists, and their area."""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tests.applications.images import SPECS, filtered, load_model
from tests.hdl.ghdl import GhdlError, Library, core_files
from tests.hdl.verilator import HEADERS
from tools.bench.model import ModelError
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell
from tools.bench.yosys import SynthesisError, Yosys

TITLE = "Accelerators for images, 1920 x 1080"
WIDTHS = (8, 64, 128)
CORES = ("axis/package", "axis/axis", "acc/image/image")
# Rows and columns.
FULL_HD = (1080, 1920)

_HERE = Path(__file__).parent
_COLUMNS = ("accelerator", "bits", "cycles", "first to last", "pixels a cycle", "LUT/FF", "block RAM", "bar", "result")
_NOTE = """
    The input is a noise image without stalls; every byte of the result equals the model's. 'cycles' is the number of
    cycles of the whole message, from its first segment to its end. 'first to last' is the number of cycles from the
    first to the last beat of data, both included, at the slower side of the accelerator. 'pixels a cycle' is the number
    of pixels of the input divided by 'first to last'. The sums of the integral image have 32 bits, so a 64-bit stream
    carries at most two pixels per cycle. resize_image makes four pixels of each, two in a cycle.
    """


@dataclass(frozen=True)
class Accelerator:
    """An accelerator: its system, its entity, the bytes of its pixels."""

    system: str
    entity: str
    channels: int
    widths: tuple[int, ...] = WIDTHS

    @property
    def encoding(self) -> str:
        """The encoding of its images."""
        return "rgb8" if self.channels == 3 else "mono8"


ACCELERATORS = (
    Accelerator("image_pipeline", "rgb_to_gray", 3),
    Accelerator("image_pipeline", "scale_down", 1),
    Accelerator("image_pipeline", "integral_image", 1),
    Accelerator("sobel", "sobel", 1),
    Accelerator("resize", "resize_image", 3, (64, 128)),
)
_GRAY_AT_MOST = 1.05
_PIXELS_AT_LEAST = 2.0


@dataclass(frozen=True)
class Run:
    """A processed message: cycles, those from first to last data, and the result."""

    cycles: int
    data_cycles: int
    fields: tuple[int, int, int, str, str]
    data: bytes


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(item.entity, str(width)) for item in ACCELERATORS for width in item.widths]}


def measure(yosys: Yosys, seed: int, tell: Tell) -> list[Table]:
    """Simulate and synthesise all; `tell` hears of each."""
    yosys.prepare()
    rows = []
    for item in ACCELERATORS:
        for width in item.widths:
            with tempfile.TemporaryDirectory() as folder:
                row = _row(item, width, seed, Path(folder), yosys, tell)
            tell(" ".join(row))
            rows.append(row)
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def _row(item: Accelerator, width: int, seed: int, folder: Path, yosys: Yosys, tell: Tell) -> tuple[str, ...]:
    key = (item.entity, str(width))
    shape = (*FULL_HD, 3) if item.channels == 3 else FULL_HD
    pixels = np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)
    try:
        netlist = library(folder).synthesise(item.entity, {"WIDTH": width}, "verilog")
        program = model(netlist, item.entity, width, folder)
        found = run(program, item.encoding, pixels, folder)
        cells = yosys.cells(netlist, item.entity)
    except (ModelError, SynthesisError, GhdlError) as error:
        tell(f"{' '.join(key)}: {error}")
        return (*key, "", "", "", "", "", "", FAILED)
    if (found.fields, found.data) != expected(item, pixels):
        return (*key, "", "", "", "", "", "", FAILED)
    rate = FULL_HD[0] * FULL_HD[1] / found.data_cycles
    bar, is_met = _bar(item, width, found.cycles, rate, pixels.size)
    result = (MET if is_met else MISSED) if bar else ""
    return (*key, str(found.cycles), str(found.data_cycles), f"{rate:.3f}", str(cells), str(cells.block), bar, result)


def _bar(item: Accelerator, width: int, cycles: int, rate: float, size: int) -> tuple[str, bool]:
    """Return the limit and whether it is met; empty without a limit."""
    if item.entity == "rgb_to_gray" and width == 128:
        most = int(_GRAY_AT_MOST * size * 8 / width)
        return f"{most} cycles", cycles <= most
    if item.channels == 1 and width == 64:
        return f"{_PIXELS_AT_LEAST:.0f} pixels", rate >= _PIXELS_AT_LEAST
    return "", True


def expected(item: Accelerator, pixels: npt.NDArray[np.uint8]) -> tuple[tuple[int, int, int, str, str], bytes]:
    """Return the model's result for an image."""
    message = {
        "header": {"frame_id": "camera"},
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": item.encoding,
        "step": pixels.shape[1] * item.channels,
        "data": pixels.tobytes(),
    }
    result = filtered(load_model(item.system), item.entity, message)
    fields = (result["height"], result["width"], result["step"], result["encoding"], result["header"]["frame_id"])
    return fields, result["data"]


def library(folder: Path) -> Library:
    """Analyse all accelerators and their dependencies in `folder`."""
    Library("firm", folder).analyse(core_files(*CORES))
    work = Library("work", folder)
    work.analyse(SPECS / item.system / "rtl" / f"{item.entity}.vhd" for item in ACCELERATORS)
    return work


def model(netlist: str, entity: str, width: int, folder: Path) -> Path:
    """The program of a netlist and its bench; raises `ModelError`."""
    (folder / "netlist.v").write_text(netlist, encoding="utf-8")
    flags = f"-I{HEADERS} -DLANES={width // 8}"
    command = ["verilator", "--cc", "--exe", "--build", "-O3", "-CFLAGS", flags, "-Wno-fatal", "-Wno-INITIALDLY"]
    for option in ("OPT_FAST=-O2", "OPT_SLOW=-O0", "OPT_GLOBAL=-O0"):
        command += ["-MAKEFLAGS", option]
    command += ["--top-module", entity, "--prefix", "Vimage", "--Mdir", "model", "netlist.v", str(_HERE / "image.cpp")]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ModelError(done.stdout + done.stderr)
    return folder / "model" / "Vimage"


def run(program: Path, encoding: str, pixels: npt.NDArray[np.uint8], folder: Path) -> Run:
    """Send an image, (rows, columns) or (rows, columns, 3); raises `ModelError`."""
    data = pixels.tobytes()
    (folder / "data").write_bytes(len(data).to_bytes(4, "little") + data)
    height, width = pixels.shape[:2]
    sizes = [str(height), str(width), str(len(data) // height)]
    command = [str(program), "camera", encoding, *sizes, "data", "result"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ModelError(done.stderr.strip() or f"ended with {done.returncode}")
    shown, counted = done.stdout.splitlines()
    rows, columns, step, given_encoding, frame_id = shown.split()
    first_in, last_in, first_out, last_out, cycles = map(int, counted.split())
    data_cycles = max(last_in - first_in, last_out - first_out) + 1
    fields = (int(rows), int(columns), int(step), given_encoding, frame_id)
    return Run(cycles, data_cycles, fields, (folder / "result").read_bytes())
