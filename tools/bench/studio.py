"""Time that the page of `firm studio` takes: to draw a large system, and from an edit to its faults."""

from __future__ import annotations

import asyncio
import random
import re
import statistics
import tempfile
from pathlib import Path

from tests.random_systems import random_system
from tests.studio.browser import PROGRAM, Page, opened
from tests.studio.served import served
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows

BLOCKS, MESSAGES = 60, 20
TITLE = f"The page with a system of {BLOCKS} blocks"
RUNS = 5

_COLUMNS = ("what", "ms", "bar, ms", "result")
_NOTE = f"""
    Times are medians of {RUNS} runs in a headless Chromium. 'first picture' lasts from the request of the page until
    all blocks are placed, without the start of the browser; 'ids and sizes' until those are shown, with all faults.
    'an edit' lasts from the change of a block's message to an unknown one until the block shows its fault.
    """
_BARS = {"first picture": 1000, "ids and sizes": None, "an edit": 300}
# A browser that has just started takes some 0.4 s until it requests the page.
_NOW = "performance.now() - performance.getEntriesByType('navigation')[0].requestStart"
# The moment at which the last block is in its place.
_PLACED = f"""new Promise(done => {{
    const look = () => document.querySelectorAll('.svelte-flow__node').length > {BLOCKS} + 1
        ? done({_NOW}) : requestAnimationFrame(look);
    look();
}})"""
_DERIVED = f"""new Promise(done => {{
    const look = () => document.querySelector('header output.good')?.textContent === 'no faults'
        && ![...document.querySelectorAll('.block .line')].some(line => line.textContent === '...')
        ? done({_NOW}) : requestAnimationFrame(look);
    look();
}})"""
_EDITED = """new Promise(done => {
    const label = [...document.querySelectorAll('aside label')].find(label => label.textContent === 'message');
    const input = document.getElementById(label.htmlFor);
    const start = performance.now();
    input.value = 'no_msgs/Such';
    input.dispatchEvent(new Event('change', {bubbles: true}));
    const look = () => document.querySelector('.block .mark')
        ? done(performance.now() - start) : requestAnimationFrame(look);
    look();
})"""


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(name,) for name in _BARS]}


def measure(seed: int, tell: Tell, written: str = "", pattern: str = "") -> list[Table]:
    """Open the page several times, and edit a block each time; `tell` hears of each row."""
    if not re.search(pattern, TITLE):
        known = known_rows(written, TITLE, _COLUMNS, keys=1)
        rows = [known.get((name,), (name, "", str(bar or ""), NOT_MEASURED)) for name, bar in _BARS.items()]
        return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]
    times: dict[str, list[float]] = {name: [] for name in _BARS}
    if PROGRAM:
        with tempfile.TemporaryDirectory() as place:
            spec = Path(place, "spec.yaml")
            spec.write_text(random_system(random.Random(seed), BLOCKS, MESSAGES).text, encoding="utf-8")
            with served(spec) as studio:
                for run in range(RUNS):
                    found = asyncio.run(_times(studio.address, Path(place, f"profile_{run}")))
                    for name, milliseconds in zip(_BARS, found, strict=True):
                        times[name].append(milliseconds)
    else:
        tell("Chromium is missing")
    rows = []
    for name, bar in _BARS.items():
        rows.append(_row(name, times[name], bar))
        tell(" ".join(rows[-1]))
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def _row(name: str, times: list[float], bar: int | None) -> tuple[str, ...]:
    if not times:
        return (name, "", str(bar or ""), FAILED)
    median = statistics.median(times)
    return (name, f"{median:.0f}", str(bar or ""), "" if bar is None else MET if median <= bar else MISSED)


async def _times(address: str, profile: Path) -> tuple[float, float, float]:
    """The milliseconds until the first picture, until its facts, and of an edit, which is then taken back."""
    async with opened(address, profile) as page:
        await page.until("document.readyState === 'complete'")
        first = float(await page.evaluate(_PLACED))
        derived = float(await page.evaluate(_DERIVED))
        await _select_converter(page)
        edit = float(await page.evaluate(_EDITED))
        await page.click("header button:nth-of-type(2)")
        await page.until("document.querySelector('.block .mark') === null")
    return first, derived, edit


async def _select_converter(page: Page) -> None:
    await page.click(".svelte-flow__node:has(.subscriber)")
    await page.until("document.querySelector('aside h2').textContent.startsWith('subscriber')")
