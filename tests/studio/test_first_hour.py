"""The path of the first hour, in the browser: a new project begins, gets a second accelerator, runs, shows its latency.

All of it is done in the page. Only the accelerator's computation is written as in an editor beside it.
"""

from __future__ import annotations

import asyncio
from functools import partial
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.node.transport.built_simulator import build_simulator
from tests.studio.browser import PROGRAM, Page, shared_browser
from tests.studio.served import served
from tests.studio.test_page import ROOM, block
from tests.studio.test_watching import STATE, press

# The latencies of the listed messages in cycles of clk; the first message after the reset takes longer.
_LATENCIES = """[...document.querySelectorAll('.messages tbody tr')].slice(2)
    .map(row => row.lastElementChild.textContent).filter(Boolean)
    .map(text => Number(text.match(/^(\\d+) cycles/)[1]))"""
_MINUTES = 10
# The skeleton of `firm init` has no register; this accelerator has one for a message, so that it takes a cycle.
_REGISTERED = """architecture rtl of tilt is

  signal is_full : std_logic;

begin

  in_msg_ready <= not is_full or out_msg_ready;
  out_segment_valid <= (others => is_full);

  store : process (clk) is
  begin

    if rising_edge(clk) then
      if rst_n = '0' then
        is_full <= '0';
      elsif in_msg_valid = '1' and (is_full = '0' or out_msg_ready = '1') then
        is_full <= '1';
        out_x <= in_x;
        out_y <= in_y;
        out_z <= in_z;
      elsif out_msg_ready = '1' then
        is_full <= '0';
      end if;
    end if;

  end process;

end architecture;
"""


async def measured(page: Page) -> int:
    """Run the system that is drawn, and return the least latency of ten messages."""
    await press(page, "run")
    for _ in range(_MINUTES * 60):
        if await page.evaluate(f"{STATE}.endsWith('running') && {_LATENCIES}.length >= 10"):
            break
        assert not await page.evaluate(f"{STATE}.endsWith('failed')"), await page.evaluate("document.body.innerText")
        await asyncio.sleep(0.5)
    found: list[int] = await page.evaluate(_LATENCIES)
    await press(page, "stop")
    await page.until(f"{STATE}.endsWith('ended')")
    return min(found)


@pytest.mark.check
@pytest.mark.skipif(not PROGRAM, reason="Chromium is missing")
@pytest.mark.skipif(not (ROOM / "static" / "index.html").exists(), reason="make studio builds the page")
def test_a_system_is_begun_extended_run_and_measured(tmp_path: Path) -> None:
    folder = tmp_path / "hour"
    folder.mkdir()
    spec, source = folder / "tilt" / "tilt.yaml", folder / "tilt" / "rtl" / "tilt.vhd"

    async def steps(page: Page) -> None:
        # The form of an empty folder: name, two messages, language, width.
        await page.until("document.activeElement?.id === 'begin-name'")
        await page.until("document.querySelectorAll('dialog .choices option').length > 10")
        await page.write("tilt")
        for _ in range(2):
            await page.press("Tab")
            await page.evaluate("document.activeElement.select()")
            await page.write("geometry_msgs/Vector3")
        await page.press("Tab", "Tab", "3", "Tab", "Tab", "Enter")
        await page.until("document.querySelectorAll('.svelte-flow__node').length === 5")
        await page.until("document.querySelector('header output').textContent === 'no faults'")
        assert yaml.safe_load(spec.read_text(encoding="utf-8"))["project"]["width"] == 32
        text = source.read_text(encoding="utf-8")
        source.write_text(text.partition("architecture")[0] + _REGISTERED, encoding="utf-8")
        before = await measured(page)
        # The second accelerator, between the first one and the publisher.
        await page.evaluate("document.activeElement.blur()")
        await page.press("a")
        await page.until("document.activeElement?.id === 'add-words'")
        await page.write("tilt")
        await page.until("document.querySelector('dialog li b')?.textContent === 'tilt'")
        await page.press("Tab", "Enter")
        await page.until("document.querySelectorAll('.svelte-flow__node').length === 6")
        await page.drag(f"{block('tilt')} .svelte-flow__handle-right", f"{block('tilt_1')} .svelte-flow__handle-left")
        await page.until("""document.querySelector('[aria-label="connection from tilt to tilt_1"]') !== null""")
        await page.drag(f"{block('tilt_1')} .svelte-flow__handle-right", f"{block('pub')} .svelte-flow__handle-left")
        await page.until("""document.querySelector('[aria-label="connection from tilt_1 to pub"]') !== null""")
        await page.evaluate("""document.querySelector('[aria-label="connection from tilt to pub"]').focus()""")
        await page.press("Enter", "Backspace")
        await page.until("document.querySelectorAll('.svelte-flow__edge').length === 5")
        await page.until("document.querySelector('header output').textContent === 'no faults'")
        after = await measured(page)
        print(f"latency: {before} cycles, with the second accelerator {after}")
        assert after == before + 1

    async def all_steps(address: str) -> None:
        async with shared_browser().opened(address) as page:
            try:
                await steps(page)
            finally:
                await page.picture(tmp_path / "page.png")
                print(f"the page at the end: {tmp_path / 'page.png'}")
            assert page.trouble == []

    with served(folder, partial(build_simulator, build_root=tmp_path / "simulators")) as studio:
        asyncio.run(all_steps(studio.address))
    blocks = {item["name"]: item for item in yaml.safe_load(spec.read_text(encoding="utf-8"))["blocks"]}
    ways = {name: [way["name"] for way in item.get("outgoing", ())] for name, item in blocks.items()}
    assert ways == {"sub": ["tilt"], "tilt": ["tilt_1"], "tilt_1": ["pub"], "pub": []}
