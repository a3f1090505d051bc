"""What a page costs that watches a run at a high rate: processor time beside the simulation, and memory of the page."""

from __future__ import annotations

import asyncio
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiohttp

from tests.studio.browser import PROGRAM, Page, opened
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows

RATE, PHASE_SECONDS, PAIRS, MINUTES = 1000, 10, 12, 10
TITLE = f"A run of {RATE:,} messages a second that the page watches"
COST, FRAMES, MEMORY = "processor time of a cycle, to unwatched", "frames a second", "memory at the end, to the start"
# The least or greatest value.
_BARS = {COST: 1.05, FRAMES: 18.0, MEMORY: 1.05}
_COLUMNS = ("what", "value", "bar", "result")
_NOTE = f"""
    Verilator simulates quat2euler at 8 bits, which gets {RATE:,} messages a second. Processor time is that of the
    server and the simulator, for each simulated cycle of clk. It is compared in {PAIRS} pairs of {PHASE_SECONDS} s with
    and without a page that has loaded, in alternating order; the first value is the median of their quotients. Frames
    are updates of the page, which the server limits to 20 a second. Memory is the heap of the page after a collection,
    after {MINUTES} minutes and after one, with the list of messages and the picture shown.
    """
_FIRM = [sys.executable, "-m", "fusesoc_firm.cli"]
_TICKS = os.sysconf("SC_CLK_TCK")
# Updates of the page are counted at the words of the wires.
_COUNT = """(() => {
    window.frames_seen = 0;
    let shown = '';
    const look = () => {
        const words = document.querySelector('.messages p').textContent;
        window.frames_seen += words !== shown;
        shown = words;
        requestAnimationFrame(look);
    };
    look();
})()"""

# The comparison of the accelerators' sources with their interfaces is the last thing that an opened page asks for.
_SETTLED = "performance.getEntriesByType('resource').some(entry => entry.name.includes('/api/sources?'))"


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(name,) for name in _BARS]}


def measure(tell: Tell, written: str = "", pattern: str = "") -> list[Table]:
    """Watch a run, compare it with the unwatched run, and wait for the page's memory; `tell` hears of each row."""
    if not re.search(pattern, TITLE):
        known = known_rows(written, TITLE, _COLUMNS, keys=1)
        rows = [known.get((name,), (name, "", f"{bar:.2f}", NOT_MEASURED)) for name, bar in _BARS.items()]
        return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]
    found: dict[str, float] = {}
    if PROGRAM:
        with tempfile.TemporaryDirectory() as place, _studio(Path(place)) as (address, process):
            found = asyncio.run(_watched(address, process, Path(place), tell))
    else:
        tell("Chromium is missing")
    rows = []
    for name, bar in _BARS.items():
        rows.append(_row(name, found.get(name), bar))
        tell(" ".join(rows[-1]))
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def _row(name: str, value: float | None, bar: float) -> tuple[str, ...]:
    if value is None:
        return (name, "", f"{bar:.2f}", FAILED)
    is_met = value >= bar if name == FRAMES else value <= bar
    return (name, f"{value:.2f}", f"{bar:.2f}", MET if is_met else MISSED)


@contextmanager
def _studio(folder: Path) -> Iterator[tuple[str, int]]:
    """The address and the process of `firm studio` for a copy of quat2euler."""
    subprocess.run([*_FIRM, "init", "--example", "quat2euler"], cwd=folder, check=True, capture_output=True)
    command = [*_FIRM, "studio", "quat2euler.yaml", "--no-browser"]
    process = subprocess.Popen(command, cwd=folder / "quat2euler", stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout
        yield process.stdout.readline().strip(), process.pid
    finally:
        process.terminate()
        process.wait()


async def _watched(address: str, process: int, folder: Path, tell: Tell) -> dict[str, float]:
    async with aiohttp.ClientSession() as session, opened("about:blank", folder / "profile") as page:
        wishes = {"file": "quat2euler.yaml", "tool": "verilator", "rate": RATE, "isEndless": True}
        async with session.post(f"{address}api/run", json=wishes) as answer:
            answer.raise_for_status()
        while not await _cycle(session, address):
            await asyncio.sleep(0.5)
        quotients, frames = [], []
        for number in range(PAIRS):
            costs = {}
            # A slow change of the machine's speed does not favour either.
            for is_watched in (number % 2 > 0, number % 2 == 0):
                await (_show(page, address) if is_watched else _leave(page))
                costs[is_watched] = await _cost(session, address, process)
                if is_watched:
                    frames.append(await page.evaluate("window.frames_seen") / PHASE_SECONDS)
            quotients.append(costs[True] / costs[False])
            tell(f"{quotients[-1]:.3f} of {costs[False] * 1e9:.0f} ns a cycle, {frames[-1]:.1f} frames a second")
        await _show(page, address)
        heaps = []
        for minute in range(1, MINUTES + 1):
            await asyncio.sleep(60)
            heaps.append(await _heap(page))
            tell(f"{heaps[-1] / 1e6:.2f} MB after {minute} minutes")
    return {
        COST: statistics.median(quotients),
        FRAMES: statistics.median(frames),
        MEMORY: heaps[-1] / heaps[0],
    }


async def _show(page: Page, address: str) -> None:
    """Open the page at its list of messages, and begin to count the updates once all faults of the system are known."""
    await page.call("Page.navigate", url=address)
    while not await page.evaluate(_SETTLED):
        await asyncio.sleep(0.2)
    await page.until("document.querySelectorAll('.messages tbody tr').length >= 100")
    await page.evaluate(_COUNT)


async def _leave(page: Page) -> None:
    """Close the page, and leave the server and the browser time to note it."""
    await page.call("Page.navigate", url="about:blank")
    await asyncio.sleep(2)


async def _cost(session: aiohttp.ClientSession, address: str, process: int) -> float:
    """The seconds of processors for a simulated cycle, over a phase."""
    cycles, seconds = await _cycle(session, address), _processor_seconds(process)
    end = time.monotonic() + PHASE_SECONDS
    while time.monotonic() < end:
        await asyncio.sleep(0.2)
    return (_processor_seconds(process) - seconds) / (await _cycle(session, address) - cycles)


async def _cycle(session: aiohttp.ClientSession, address: str) -> int:
    """The last cycle of the latest burst, or 0 before the first."""
    async with session.get(f"{address}api/timeline") as answer:
        grants: list[Any] = json.loads(await answer.text())["grants"]
    return int(grants[-1][2]) if grants else 0


async def _heap(page: Page) -> float:
    await page.call("HeapProfiler.collectGarbage")
    found = await page.call("Runtime.getHeapUsage")
    return float(found["usedSize"])


def _processor_seconds(process: int) -> float:
    """The seconds of a process and of all that it has started and not waited for."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        below = Path(f"/proc/{process}/task").glob("*/children")
        children = [int(child) for file in below for child in re.findall(r"\d+", file.read_text(encoding="utf-8"))]
    except OSError:
        return 0.0
    return (int(text[11]) + int(text[12])) / _TICKS + sum(map(_processor_seconds, children))
