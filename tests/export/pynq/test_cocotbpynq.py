"""The drivers of overlays before simulated systems, through cocotbpynq: PYNQ's interface in cocotb, by others.

Its engine sends and receives words of 32 bits without `tkeep`. Messages of ROS 2 fill whole words. With a stream of 8
bits, each word carries one byte, as many bytes as an engine with `tkeep` would transfer.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.tools.library_path import library_root
from tests.hdl.ghdl import REPOSITORY
from tests.seeds import seeded

pytestmark = [
    pytest.mark.skipif(not find_spec("cocotbpynq"), reason="cocotbpynq is not installed"),
    pytest.mark.check,
]

SEED = seeded(20261202)
COUNT = 1000
CORE = """\
CAPI=2:
name: me:robots:{system}:1.0
filesets:
  base: {{depend: ["~robot:firm:firm_system:0.2.0", "~robot:acc:firm_cordic:0.2.0", "~robot:acc:firm_float64:0.2.0"]}}
  bench:
    files: [bench.py: {{copyto: bench.py}}, model.py: {{copyto: model.py}}]
    file_type: user
generate:
  system: {{generator: far, position: prepend, parameters: {{spec: {system}.yaml}}}}
targets:
  default: {{filesets: [base, bench], generate: [system], toplevel: {system}_system, flow: sim,
    flow_options: {{tool: ghdl, cocotb_module: bench}}, flags: {{firm_launcher: true}}}}
"""
# What all benches share: undriven inputs, the random messages, the bytes that the system sent.
COMMON = """\
import os
import random

import cocotb
import cocotbpynq
import numpy as np
from cocotb.task import resume
from cocotb.triggers import ClockCycles
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.transport.pynq_channels import ChannelTransport
from model import respond

seed, count = int(os.environ["BENCH_SEED"]), int(os.environ["BENCH_COUNT"])
print(f"seed {seed}")
chance = random.Random(seed)
bursts = []
receive = ChannelTransport.receive


def recorded(transport, timeout=None):
    burst = receive(transport, timeout)
    if burst:
        bursts.append(burst.data)
    return burst


ChannelTransport.receive = recorded


def load(name):
    top = cocotb.top
    for port in ("tdata", "tvalid", "tlast", "tuser"):
        getattr(top, f"s_axis_{port}").value = 0
    top.m_axis_tready.value = 0
    top.s_axis_tkeep.value = (1 << len(top.s_axis_tkeep)) - 1
    return cocotbpynq.Overlay(f"{name}.bit")


def answers(overlay, block, message):
    codec = overlay.subscribers[block]
    return [
        pack_frame(overlay.PUBLISHERS[publisher].id, overlay.publishers[publisher].encode(found))
        for publisher, found in respond(block, codec.decode(codec.encode(message)))
    ]
"""
WORDS = """

from obstacle_zynq7000 import ObstacleOverlay


def run(dut=None):
    dma = load("obstacle_zynq7000").dma
    with ObstacleOverlay.over(dma, cocotbpynq.allocate, size=512, drives_tkeep=False) as overlay:
        for number in range(count):
            message = {
                "header": {"frame_id": "f" * chance.randrange(100)},
                "min_range": chance.uniform(0, 0.4),
                "range": chance.choice([chance.uniform(-0.2, 1.0), float("-inf"), float("inf")]),
            }
            overlay.send("distance", message)
            publisher, found = overlay.receive()
            assert (publisher, [bursts[-1]]) == ("alarm", answers(overlay, "distance", message)), (number, message)
    assert len(bursts) == count


test = cocotbpynq.synctest(run)
"""
BYTES = """

from quat2euler_zynq7000 import Quat2eulerOverlay

UNUSED = 0xFFFFFFFF


@resume
async def pass_time():
    await ClockCycles(cocotb.top.clk, 16)


class Channel:
    '''A channel with one byte in each word, which tells what PYNQ's channels tell; reading it takes time.'''

    def __init__(self, channel):
        self._channel = channel
        self.error, self.transferred = False, 0

    @property
    def idle(self):
        pass_time()
        return self._channel.is_idle.is_set()

    def transfer(self, array, start=0, nbytes=0):
        self._bytes = array[start : start + (nbytes or array.nbytes)]
        self._words = np.full(len(self._bytes), UNUSED, "u4")
        if self._channel.direction == "write":
            self._words[:] = self._bytes
        self._channel.transfer(self._words)

    def wait(self):
        self._channel.wait()
        self.transferred = int(np.count_nonzero(self._words != UNUSED))
        self._bytes[: self.transferred] = self._words[: self.transferred]


class Engine:
    def __init__(self, dma):
        self.sendchannel, self.recvchannel = Channel(dma.sendchannel), Channel(dma.recvchannel)


def number():
    kind = chance.randrange(20)
    return [0.0, -0.0, float("nan"), float("inf"), 1e-320][kind] if kind < 5 else chance.uniform(-1, 1)


def run(dut=None):
    engine = Engine(load("quat2euler_zynq7000").dma)
    with Quat2eulerOverlay.over(engine, cocotbpynq.allocate, size=64) as overlay:
        wanted = []
        while len(wanted) < count:
            size = min(count - len(wanted), chance.randrange(1, 12))
            lot = [{axis: number() for axis in "xyzw"} for _ in range(size)]
            wanted += [frame for message in lot for frame in answers(overlay, "QuaternionToEuler_sub", message)]
            overlay.send("QuaternionToEuler_sub", *lot, timeout=60)
            assert len(overlay.receive_all(len(lot), timeout=60)) == len(lot)
        assert bursts == wanted
        assert overlay.receive(timeout=0.01) is None
        try:
            overlay.send("QuaternionToEuler_sub", *[{}] * 100, timeout=0)
        except TimeoutError:
            return
        raise AssertionError("a hundred messages took no time")


test = cocotbpynq.synctest(run)
"""

BENCHES = {("obstacle", 32): WORDS, ("quat2euler", 8): BYTES}


def run(folder: Path, system: str, bench: str, *, width: int) -> str:
    """Run a bench of a system with its overlay's package; return the log."""
    specs = REPOSITORY / "specs" / system
    for path in (*specs.glob("*.vhd"), *specs.glob("rtl/*.vhd"), specs / "model.py"):
        target = folder / path.relative_to(specs)
        target.parent.mkdir(exist_ok=True)
        shutil.copy(path, target)
    text = (specs / f"{system}.yaml").read_text(encoding="utf-8")
    project = f"project: {{name: {system}, width: {width}}}"
    text = re.sub(r"^project:(.*\n(?:  .*\n)*)", f"{project}\n", text, count=1, flags=re.MULTILINE)
    (folder / f"{system}.yaml").write_text(text, encoding="utf-8")
    (folder / f"{system}.core").write_text(CORE.format(system=system), encoding="utf-8")
    (folder / "bench.py").write_text(COMMON + bench, encoding="utf-8")
    description = (Path(__file__).parent / "system.hwh").read_text(encoding="utf-8")
    name = f"{system}_zynq7000"
    (folder / f"{name}.hwh").write_text(description.replace("TOP", f"{system}_system"), encoding="utf-8")
    libraries = {"firm": str(library_root()), "me": "."}
    places = "".join(f"[library.{each}]\nlocation = {place}\n" for each, place in libraries.items())
    (folder / "fusesoc.conf").write_text(f"[main]\nignored_dirs = build\n{places}", encoding="utf-8")
    spec = str(folder / f"{system}.yaml")
    assert main(["pynq", spec, "--board", "zynq7000", "-o", str(folder / "overlay")]) == 0
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(REPOSITORY), str(folder / "overlay"), os.environ.get("PYTHONPATH", "")]),
        "FUSESOC_FIRM_CACHE": str(folder / "store"),
        "HWH_LOCATION_DIR": str(folder),
        "BENCH_SEED": str(SEED),
        "BENCH_COUNT": str(COUNT),
    }
    command = [
        sys.executable,
        "-m",
        "fusesoc_firm.cli",
        "build",
        "--target",
        "default",
        "--verbose",
        f"me:robots:{system}",
    ]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"seed {SEED}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.mark.parametrize(("system", "width"), BENCHES)
def test_messages_are_those_of_the_model(tmp_path: Path, system: str, width: int) -> None:
    print(f"seed {SEED}")
    log = run(tmp_path, system, BENCHES[system, width], width=width)
    assert re.search(r"TESTS=1 PASS=1 FAIL=0", log)
