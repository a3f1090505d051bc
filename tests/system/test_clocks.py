"""Clocks and widths of accelerators: where the ends of connections differ, and what is shown and made of it."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.configuration import (
    SYSTEM_TEMPLATE,
    TEST_BENCH_TEMPLATE,
    system_configuration,
)
from fusesoc_firm.system.hardware.configuration import (
    test_bench_configuration as bench_configuration,
)
from fusesoc_firm.system.hardware.crossings import all_crossings
from fusesoc_firm.system.views.diagram import diagram
from fusesoc_firm.system.views.show import derived_description
from fusesoc_firm.text.render import render
from tests.system.systems import accelerator, converter, derived, specification

CLOCKS = "[{name: fast, frequency: 0.25 GHz}, {name: slow, frequency: 1 MHz}]"
PROJECT = f"{{name: robot, width: 32, clock: 100 MHz, clocks: {CLOCKS}}}"
IMAGE = "sensor_msgs/Image"


def block(name: str, type_: str, *outgoing: str, clock: str = "") -> str:
    ways = ", ".join(f"{{name: {other}}}" for other in outgoing)
    return f"  - {{name: {name}, type: {type_}, clock: {clock or '~'}, outgoing: [{ways}]}}\n"


def of_width(line: str, width: int) -> str:
    return line.replace("sources:", f"width: {width}, sources:")


@pytest.fixture
def system(tmp_path: Path) -> DerivedSystem:
    """A fork into three domains; two widths in a row; and a message of fixed size that comes from two domains."""
    types = accelerator("narrow", IMAGE, IMAGE) + of_width(accelerator("wide", IMAGE, IMAGE), 128)
    types += of_width(accelerator("turn", "Point", "Point"), 8)
    blocks = (
        converter("sub", "subscriber", IMAGE, "a", "b", "plain")
        + block("a", "narrow", "c", clock="fast")
        + block("b", "narrow", "d", clock="slow")
        + block("c", "wide", "first", clock="fast")
        + block("d", "narrow", "second", clock="slow")
        + block("plain", "wide", "third")
        + "".join(
            converter(name, "publisher", IMAGE).replace("mode", "buffer: 500, mode")
            for name in ("first", "second", "third")
        )
        + converter("point", "subscriber", "Point", "t")
        + block("t", "turn", "point_out", clock="fast")
        + converter("point_out", "publisher", "Point")
    )
    return derived(tmp_path, specification(blocks, types, PROJECT))


def test_a_crossing_stands_where_the_ends_differ(system: DerivedSystem) -> None:
    found = [(item.source.block, item.sink.block, item.clocks, item.widths) for item in all_crossings(system)]
    # None from b to d, which are of one domain; what has no stream has no width.
    assert found == [
        ("sub", "a", "clk to clk_fast", ""),
        ("sub", "b", "clk to clk_slow", ""),
        ("sub", "plain", "", "32 to 128 bits"),
        ("a", "c", "", "32 to 128 bits"),
        ("c", "first", "clk_fast to clk", "128 to 32 bits"),
        ("d", "second", "clk_slow to clk", ""),
        ("plain", "third", "", "128 to 32 bits"),
        ("point", "t", "clk to clk_fast", ""),
        ("t", "point_out", "clk_fast to clk", ""),
    ]


def test_clocks_are_read(system: DerivedSystem) -> None:
    assert [(item.port, item.frequency, item.ratio) for item in system.clocks] == [
        ("clk_fast", Fraction(250 * 10**6), Fraction(5, 2)),
        ("clk_slow", Fraction(10**6), Fraction(1, 100)),
    ]


def test_the_description_tells_domains_and_crossings(system: DerivedSystem) -> None:
    shown = derived_description(system)
    assert shown["System"]["clocks"][0] == {"name": "fast", "port": "clk_fast", "hertz": 250e6}
    blocks = {item["name"]: (item.get("clock"), item.get("width")) for item in shown["Accelerators"]}
    assert blocks["c"] == ("clk_fast", 128)
    assert blocks["plain"] == (None, 128)
    assert blocks["d"] == ("clk_slow", None)
    assert shown["Crossings"][0] == {"from": "sub", "to": "a/in", "clocks": "clk to clk_fast"}
    assert shown["Crossings"][3] == {"from": "a/out", "to": "c/in", "widths": "32 to 128 bits"}


def test_the_diagram_tells_domains_and_crossings(system: DerivedSystem) -> None:
    text = diagram(system)
    assert "clk_fast: 250 MHz<br/>128 bits" in text
    dashed = re.findall(r'"block \w+" -> "block \w+" \[label=<.*> style=dashed\]', text)
    assert len(dashed) == len(all_crossings(system))


def test_the_top_level_says_which_paths_cross(system: DerivedSystem) -> None:
    text = render(SYSTEM_TEMPLATE, system_configuration(system))
    assert re.search(r"clk_fast +: in  std_logic;  -- 250 MHz: a, c, t\n", text)
    assert "-- clk_fast, 128 bits\n  u_c : entity work.wide" in text
    assert "-- crossing c to first: from clk_fast to clk, 128 to 32 bits" in text
    assert "--   max delay of a cycle of clk_fast: every field, request_r" in text
    assert text.count("entity firm.firm_cdc_reset") == 6


def test_a_fork_is_at_its_source_clock(tmp_path: Path) -> None:
    types = accelerator("turn", "Point", "Point")
    blocks = (
        converter("sub", "subscriber", "Point", "t")
        + block("t", "turn", "left", "right", clock="fast")
        + block("right", "turn", "out", clock="slow")
        + "".join(converter(name, "publisher", "Point") for name in ("left", "out"))
    )
    text = render(SYSTEM_TEMPLATE, system_configuration(derived(tmp_path, specification(blocks, types, PROJECT))))
    (fork,) = re.findall(r"entity firm\.firm_message_fork.*?\);", text.replace("\n", " "))
    assert re.search(r"clk +=> clk_fast", fork) and re.search(r"rst_n +=> rst_fast_n", fork)
    assert text.count("entity firm.firm_cdc_message") == 4


def test_the_bench_has_each_clock(system: DerivedSystem) -> None:
    configuration = bench_configuration(system, 1, 0, "world", is_live=False)
    text = render(TEST_BENCH_TEMPLATE, configuration)
    assert re.findall(r"PERIOD_PS => (\d+)", text) == ["4000", "1000000"]
    formals = [line["actual"] for line in configuration["environment"]["ports"]]
    assert formals == ["clk", "rst_n", "clk_fast", "clk_slow"]


def test_a_system_without_clocks_has_nothing_of_it(tmp_path: Path) -> None:
    blocks = converter("sub", "subscriber", "Point", "pub") + converter("pub", "publisher", "Point")
    system = derived(tmp_path, specification(blocks))
    assert re.findall(r"firm_cdc_\w+", render(SYSTEM_TEMPLATE, system_configuration(system))) == ["firm_cdc_reset"]
    assert "Crossings" not in derived_description(system)


@pytest.mark.parametrize("names", [("released", "seen"), ("rst", "rst_n"), ("a", "a_seen")])
def test_clocks_may_be_called_like_what_is_made_of_them(tmp_path: Path, names: tuple[str, str]) -> None:
    clocks = ", ".join(f"{{name: {name}, frequency: 2 MHz}}" for name in names)
    blocks = (
        converter("sub", "subscriber", "Point", "clk")
        + block("clk", "turn", names[0], clock=names[0])
        + block(names[0], "turn", "out", clock=names[1])
        + converter("out", "publisher", "Point")
    )
    project = f"{{name: r, clock: 1 MHz, clocks: [{clocks}]}}"
    text = specification(blocks, accelerator("turn", "Point", "Point"), project)
    top = render(SYSTEM_TEMPLATE, system_configuration(derived(tmp_path, text)))
    declared = re.findall(r"^ +(?:signal )?(\w+) +: ", top, re.MULTILINE)
    assert len({name.lower() for name in declared}) == len(declared)
