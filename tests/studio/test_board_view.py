"""The view 'board' in the browser, and the three steps of a first visit, which end with a bitstream."""

from __future__ import annotations

import asyncio
import json
import shlex
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from fusesoc_firm.studio import boards
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.scaffold.core_file import CoreOptions, new_core
from tests.studio.browser import PROGRAM, Page, shared_browser
from tests.studio.played import modelled, write_system
from tests.studio.served import served
from tests.studio.test_page import AXE, ROOM
from tests.studio.test_sight import WINDOWS, measure, seen
from tests.studio.test_watching import ROWS, press, violations

pytestmark = [
    pytest.mark.check,
    pytest.mark.skipif(not PROGRAM, reason="Chromium is missing"),
    pytest.mark.skipif(not (ROOM / "static" / "index.html").exists(), reason="make studio builds the page"),
]
STEP = {"step": "synthesis", "number": 4, "count": 6, "line": "2.1. Executing a pass with a name. " * 9}
DONE = {
    "state": "done",
    "bitstream": "build/robot_sys_robot_0.1.0/icebreaker/robot_sys_robot_0.1.0.bin",
    "clocks": [{"name": "clk", "reached": 25.88, "needed": 12.0}],
    "area": [{"name": "ICESTORM_LC", "used": 1289, "available": 5280}],
}
SLOW = {
    "state": "failed",
    "clocks": [{"name": "clk", "reached": 9.5, "needed": 12.0}],
    "output": ["ERROR: Max frequency for clock 'clk': 9.50 MHz (FAIL at 12.00 MHz)"],
    "faults": [{"severity": "error", "message": "there is no bitstream for icebreaker", "hint": "the whole output: x"}],
}
WRONG = {
    "state": "failed",
    "faults": [
        {
            "severity": "error",
            "message": "it is wrong",
            "file": "robot.yaml",
            "line": 5,
            "column": 3,
            "hint": "correct it",
        },
        {"severity": "error", "message": "so is this", "file": "other.vhd", "line": 7, "column": 1},
    ],
}
BY_HAND = {
    "state": "failed",
    "faults": [
        {
            "severity": "error",
            "message": "openFPGALoader is not installed: apt-get install openfpgaloader",
            "hint": f"then run: openFPGALoader -b ice40_generic {DONE['bitstream']}",
        }
    ],
}
VIEW = "document.querySelector('.view')"
STEPS = "document.querySelector('.steps')"


def firm(folder: Path, monkeypatch: pytest.MonkeyPatch, *lines: object, then: str = "") -> None:
    """Replace the command `firm` by a script that prints lines of JSON, and does something then."""
    texts = " ".join(shlex.quote(json.dumps(line)) for line in lines)
    (folder / "firm.sh").write_text(f"printf '%s\\n' {texts}\n{then}\n", encoding="utf-8")
    monkeypatch.setattr(boards, "_FIRM", ("/bin/sh", str(folder / "firm.sh")))


def write_project(folder: Path) -> Path:
    """A system that is played by a model, with a core that has targets for boards."""
    spec = write_system(folder)
    spec.with_suffix(".core").write_text(new_core(load_beside(spec).system, spec.name, CoreOptions()), encoding="utf-8")
    return spec


async def open_view(page: Page) -> None:
    await page.until("document.querySelector('header output').textContent === 'no faults'")
    await press(page, "board", ".text > [role=group]")
    await page.choose(".view select", "icebreaker")


async def build(page: Page, words: str) -> None:
    """Build the bitstream until the view has some words."""
    await press(page, "build the bitstream", ".view")
    await page.until(f"{VIEW}.innerText.includes({json.dumps(words)})")


@pytest.mark.parametrize("size", WINDOWS, ids=str)
def test_a_build_is_readable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]) -> None:
    """Also with a long line of a program, with faults, and with the command of a loader that is missing."""

    async def steps(page: Page) -> None:
        await open_view(page)
        await measure(page)
        firm(tmp_path, monkeypatch, STEP, then="sleep 1000")
        await build(page, "4 of 6: synthesis")
        assert await page.evaluate(f"{VIEW}.querySelector('progress').value") == 3
        await measure(page)
        await press(page, "cancel", ".view")
        await page.until(f"{VIEW}.innerText.includes('cancelled')")
        for result, words in (WRONG, "so is this"), (SLOW, "9.5 MHz reached"), (DONE, "The bitstream is built"):
            firm(tmp_path, monkeypatch, STEP, result)
            await build(page, words)
            await measure(page)
            assert await page.evaluate(f"{VIEW}.scrollWidth - {VIEW}.clientWidth") == 0
        assert "25.9 MHz reached" in await page.evaluate(f"{VIEW}.innerText")
        firm(tmp_path, monkeypatch, BY_HAND)
        await press(page, "load onto the board", ".view")
        await page.until(f"{VIEW}.innerText.includes('openFPGALoader -b ice40_generic build/')")
        # The bitstream's result stays.
        assert "1289 of 5280" in await page.evaluate(f"{VIEW}.innerText")
        await page.evaluate(f"{VIEW}.scrollTop = 10000")
        await measure(page)

    seen(write_project(tmp_path), tmp_path, size, steps)


def test_a_fault_leads_to_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    firm(tmp_path, monkeypatch, WRONG)

    async def steps(page: Page) -> None:
        await open_view(page)
        await build(page, "it is wrong")
        text = await page.evaluate(f"{VIEW}.innerText")
        assert "correct it" in text and "other.vhd:7:1" in text
        await press(page, "robot.yaml:5:3", ".view")
        await page.until("document.querySelector('.cm-activeLineGutter').textContent === '5'")

    seen(write_project(tmp_path), tmp_path, (1400, 900), steps)


def test_a_board_of_other_tools_offers_a_project(tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        await open_view(page)
        await page.choose(".view select", "quartus")
        await page.until(f"{VIEW}.innerText.includes('fusesoc run --setup --target=quartus robot:sys:robot:0.1.0')")
        assert "build the bitstream" not in await page.evaluate(f"{VIEW}.innerText")
        await measure(page)

    seen(write_project(tmp_path), tmp_path, (1400, 900), steps)


def test_a_board_without_a_loader_says_so(tmp_path: Path) -> None:
    spec = write_project(tmp_path)
    (board,) = Path(boards.__file__).parents[1].glob("boards/icebreaker.yaml")
    text = board.read_text(encoding="utf-8").replace("loader: ice40_generic\n", "")
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    core = spec.with_suffix(".core")
    core.write_text(
        core.read_text(encoding="utf-8").replace("board: icebreaker}", "board: mine.yaml}"), encoding="utf-8"
    )

    async def steps(page: Page) -> None:
        await open_view(page)
        await page.until(f"{VIEW}.innerText.includes('openFPGALoader has no name for this board')")
        assert "load onto the board" not in await page.evaluate(f"{VIEW}.innerText")

    seen(spec, tmp_path, (1400, 900), steps)


@pytest.mark.skipif(not AXE.exists(), reason="make studio installs axe-core")
def test_a_build_outlives_its_page_and_keeps_the_rules_of_accessibility(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    firm(
        tmp_path, monkeypatch, STEP, then=f"while [ ! -e {tmp_path}/go ]; do sleep 0.1; done; echo '{json.dumps(DONE)}'"
    )

    async def steps(page: Page) -> None:
        await open_view(page)
        await build(page, "4 of 6: synthesis")
        await page.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        assert await violations(page) == []
        await page.call("Page.reload")
        await open_view(page)
        await page.until(f"{VIEW}.innerText.includes('4 of 6: synthesis')")
        (tmp_path / "go").touch()
        await page.until(f"{VIEW}.innerText.includes('The bitstream is built')")
        await page.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        assert await violations(page) == []

    seen(write_project(tmp_path), tmp_path, (1400, 900), steps)


def visits(folder: Path, *steps: Callable[[Page], Awaitable[None]]) -> None:
    """Open the page of a project with one browser several times, each time of a new server."""
    spec = write_project(folder)

    async def visit(address: str, page: Page, step: Callable[[Page], Awaitable[None]]) -> None:
        await page.call("Page.navigate", url=address)
        await page.until("document.querySelector('header output')?.textContent === 'no faults'")
        await step(page)
        assert page.trouble == []
        await page.call("Page.navigate", url="about:blank")

    async def all_visits() -> None:
        async with shared_browser().opened("about:blank") as page:
            for step in steps:
                with served(spec, modelled()) as studio:
                    await visit(studio.address, page, step)

    asyncio.run(all_visits())


def test_a_first_visit_leads_through_three_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is done when the thing is done, and the browser remembers that for servers at other ports."""
    firm(tmp_path, monkeypatch, DONE)
    current = f"{STEPS}.querySelector('[aria-current]')"

    async def first(page: Page) -> None:
        await measure(page)
        assert await page.evaluate(f"{current}.textContent") == "1change something"
        await page.click(".steps [aria-current]")
        await page.until("document.querySelector('aside h2').textContent === 'subscriber point'")
        # A look is not a change.
        assert await page.evaluate(f"{STEPS}.querySelectorAll('.done').length") == 0
        await page.evaluate("document.querySelector('.connect select').focus()")
        await page.choose(".connect select", "text_out")
        await page.until(f"{current}.textContent === '2simulate'")
        await page.until("!document.querySelector('header button:nth-of-type(2)').disabled")
        await press(page, "undo", "header")
        # Not before the file is as it was; the next visit begins with it.
        await page.until("document.querySelector('header button:nth-of-type(2)').disabled")

    async def second(page: Page) -> None:
        assert await page.evaluate(f"{current}.textContent") == "2simulate"
        await page.click(".steps [aria-current]")
        await page.until(f"{ROWS}.length > 1")
        await page.until(f"{current}.textContent === '3bitstream for a board'")
        await page.click(".steps [aria-current]")
        await page.choose(".view select", "icebreaker")
        await build(page, "The bitstream is built")
        await page.until(f"{STEPS}.innerText.includes('All three are done.')")
        assert await page.evaluate(f"{STEPS}.querySelectorAll('.done').length") == 3

    async def third(page: Page) -> None:
        assert await page.evaluate(STEPS) is None

    visits(tmp_path, first, second, third)


def test_the_steps_are_closed_for_good(tmp_path: Path) -> None:
    async def first(page: Page) -> None:
        await page.click(".steps > button")
        await page.until(f"{STEPS} === null")

    async def second(page: Page) -> None:
        assert await page.evaluate(STEPS) is None

    visits(tmp_path, first, second)
