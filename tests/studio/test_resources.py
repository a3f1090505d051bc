"""The synthesis that the page asks for: cells and clock of each block, kept, and ended with the connection."""

from __future__ import annotations

import asyncio
import os
import random
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.exploration import resources
from fusesoc_firm.exploration.resources import blocks_of, cells_of, slowest
from fusesoc_firm.studio.server import Studio
from fusesoc_firm.tools import sessions
from fusesoc_firm.tools.programs import find
from tests.studio.served import served

REGISTERS = 37
# A block with this many registers, and nothing else.
ARCHITECTURE = f"""architecture rtl of tilt is

  signal full : std_logic;
  signal sum : std_logic_vector({REGISTERS - 2} downto 0);

begin

  in_msg_ready <= not full or out_msg_ready;
  out_segment_valid <= (others => full);
  out_x <= std_logic_vector(resize(unsigned(sum), out_x'length));
  out_y <= in_y;
  out_z <= in_z;

  store : process (clk) is
  begin

    if rising_edge(clk) then
      if in_msg_valid = '1' and (full = '0' or out_msg_ready = '1') then
        sum <= std_logic_vector(unsigned(sum) + unsigned(in_x({REGISTERS - 2} downto 0)));
      end if;
      full <= rst_n and (in_msg_valid or (full and not out_msg_ready));
    end if;

  end process;

end architecture;
"""


@pytest.fixture
def studio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Studio]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "cache"))
    assert main(["init", "tilt", "--in", "geometry_msgs/Vector3", "--out", "geometry_msgs/Vector3"]) == 0
    spec = tmp_path / "tilt" / "tilt.yaml"
    spec.write_text(spec.read_text(encoding="utf-8").replace("project:\n", "project:\n  clock: 1 GHz\n"))
    source = tmp_path / "tilt" / "rtl" / "tilt.vhd"
    text = source.read_text(encoding="utf-8").replace("use ieee.std", "use ieee.numeric_std.all;\nuse ieee.std")
    source.write_text(text.partition("architecture")[0] + ARCHITECTURE, encoding="utf-8")
    with served(spec) as studio:
        yield studio


async def asked(studio: Studio) -> list[dict[str, Any]]:
    """Ask for the resources, and return all news."""
    found: list[dict[str, Any]] = []
    address = f"{studio.address}api/resources?file=tilt.yaml"
    async with aiohttp.ClientSession() as session, session.ws_connect(address) as socket:
        while not found or found[-1]["step"] not in ("done", "failed"):
            found.append(dict(await socket.receive_json(timeout=600)))
    return found


def until_done(studio: Studio) -> list[dict[str, Any]]:
    return asyncio.run(asked(studio))


@pytest.mark.check
def test_each_block_has_cells_and_a_clock(studio: Studio) -> None:
    news = until_done(studio)
    steps = [item["step"] for item in news]
    found = {block["name"]: block for block in news[-1]["blocks"]}
    assert {"sub", "tilt", "pub", "manager", "scheduler"} <= found.keys(), news
    assert found["tilt"]["ff"] == REGISTERS
    assert all(block["lut"] > 0 for name, block in found.items() if name != "system_rst")
    assert news[-1]["wanted"] == {"": 1000}
    if not find("nextpnr-ecp5"):
        assert "pip install" in news[-1]["missing"]
        return
    assert steps == ["netlist", "cells", "places", "done"]
    assert [block["ff"] for block in news[-2]["blocks"]] == [block["ff"] for block in news[-1]["blocks"]]
    # The slowest path of the system ends in one of its blocks.
    clocks = [block["mhz"] for block in found.values() if block["mhz"]]
    assert min(clocks) == pytest.approx(news[-1]["clocks"]["clk"], rel=1e-3)
    # A second call finds the result.
    again = until_done(studio)
    assert [item["step"] for item in again] == ["netlist", "done"]
    assert again[-1] == news[-1]


def tool(folder: Path, name: str, text: str) -> None:
    """Write a program that is found first."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)


def has_ended(number: int) -> bool:
    """Whether a process has ended. In a container without an init process, an orphan stays as a zombie."""
    try:
        return " Z " in Path(f"/proc/{number}/stat").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return True


@pytest.mark.check
def test_a_page_that_leaves_ends_the_synthesis(studio: Studio, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A Yosys that never ends is ended, with the program that it has started."""
    (tmp_path / "bin").mkdir()
    noted = tmp_path / "pids"
    tool(tmp_path / "bin", "yosys", f"sleep 1000 & echo $$ $! > {noted}; wait")
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(resources, "facts_of", lambda program, path: {})

    async def started() -> list[int]:
        found: list[int] = []
        waiting = asyncio.create_task(asked(studio))
        while len(found) < 2:
            assert not waiting.done(), waiting.result()
            await asyncio.sleep(0.1)
            found = [int(word) for word in noted.read_text().split()] if noted.exists() else []
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)
        return found

    for number in asyncio.run(started()):
        while not has_ended(number):
            time.sleep(0.1)
    # The next page gets its turn.
    tool(tmp_path / "bin", "yosys", "echo nothing works; exit 3")
    last = until_done(studio)[-1]
    assert last["step"] == "failed"
    assert "nothing works" in last["reason"]


def test_a_cancelled_program_ends_at_any_moment(tmp_path: Path) -> None:
    """While it is started as well as later, and when those that it has started outlive it."""
    seed = random.randrange(2**32)
    print("seed:", seed)
    source = random.Random(seed)
    noted = tmp_path / "pids"
    noted.touch()

    async def cancelled(last: str) -> None:
        command = ["sh", "-c", f"sleep 1000 & echo $! >> {noted}; {last}"]
        running = asyncio.create_task(sessions.run(command, tmp_path, print))
        await asyncio.sleep(source.random() / 50)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    async def all_cancelled() -> None:
        await asyncio.gather(*map(cancelled, ("wait", "exit") * 20))

    asyncio.run(all_cancelled())
    for word in noted.read_text(encoding="ascii").split():
        while not has_ended(int(word)):
            time.sleep(0.1)


def test_a_system_without_a_core_is_told_so(studio: Studio, tmp_path: Path) -> None:
    for core in (tmp_path / "tilt").glob("*.core"):
        core.unlink()
    (news,) = until_done(studio)
    assert news["step"] == "failed"
    assert "firm system core tilt.yaml" in news["reason"]


def test_cells_are_those_of_all_levels() -> None:
    modules = {
        "top": {"attributes": {}, "cells": {"u_a": {"type": "pair"}, "u_b": {"type": "pair"}, "c": {"type": "LUT4"}}},
        "pair": {"attributes": {}, "cells": {"x": {"type": "LUT4"}, "y": {"type": "TRELLIS_FF"}}},
        "LUT4": {"attributes": {"blackbox": "1"}, "cells": {}},
    }
    assert cells_of(modules, "top") == {"LUT4": 3, "TRELLIS_FF": 2}
    shown = [(block["name"], block["lut"], block["ff"]) for block in blocks_of(modules, "top")]
    assert shown == [("a", 1, 1), ("b", 1, 1), ("between blocks", 1, 0)]


def test_paths_between_clocks_do_not_count() -> None:
    def net(start: str, end: str, cell: str, delay: float) -> dict[str, object]:
        return {"event": start, "endpoints": [{"event": end, "cell": cell, "delay": [0.1, delay]}]}

    timings = [
        net("posedge clk", "posedge clk", "u_a.x", 2.0),
        net("posedge clk", "posedge clk", "u_a.u_b.y", 3.0),
        net("posedge other", "posedge clk", "u_a.x", 9.0),
        net("", "", "u_a.x", 9.0),
    ]
    assert slowest({"detailed_net_timings": timings}) == {"a": 3.0}
