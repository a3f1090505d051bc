"""Writes docs/figures: the bench's results, a page for each subject, with the versions of the tools."""

from __future__ import annotations

import platform
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata

from fusesoc_firm.tools.open_flows import OPEN_FLOWS
from tests.hdl.ghdl import REPOSITORY
from tools.bench import (
    actions,
    applications,
    area,
    bitstreams,
    builds,
    codec,
    cycles,
    fuzz,
    fuzz_systems,
    images,
    inner_topics,
    kernels,
    links,
    live,
    loops,
    manager,
    network,
    nextpnr,
    noc,
    passing,
    peers,
    replay,
    resize,
    simulators,
    store,
    systems,
    timing,
    use,
    yosys,
    yowasp,
)
from tools.bench.tables import NOT_MEASURED, Table, filled

FOLDER = REPOSITORY / "docs" / "figures"


@dataclass(frozen=True)
class Page:
    """A page of figures: its file, its title, its content for a reader, and its parts of the bench."""

    name: str
    title: str
    subject: str
    parts: tuple[str, ...]


PAGES = (
    Page(
        "converters",
        "Figures of converters",
        "area, cycles, broken frames and loops",
        ("area", "cycles", "fuzz", "loops"),
    ),
    Page(
        "manager",
        "Figures of the Manager and the schedulers",
        "the area of both for each number of publishers",
        ("manager",),
    ),
    Page(
        "timing",
        "Figures of clock frequencies",
        "the clock of converters, systems, the Manager and arithmetic",
        ("timing",),
    ),
    Page(
        "peers",
        "Figures beside other libraries",
        "area and clock of our parts of streams beside those of others",
        ("peers",),
    ),
    Page(
        "channel-use",
        "Figures of channel use",
        "the channel use of schedulers, messages with arrays, and topics",
        ("use", "passing", "inner_topics"),
    ),
    Page("applications", "Figures of whole systems", "area and cycles", ("images", "links", "applications")),
    Page(
        "builds",
        "Figures of builds",
        "build and simulation times",
        ("systems", "builds", "actions", "simulators", "store"),
    ),
    Page(
        "kernels",
        "Figures of accelerators in Python",
        "their area, cycles, clock and compile time",
        ("kernels",),
    ),
    Page(
        "noc",
        "Figures of networks on chip",
        "area, clock, throughput and latency of exchanges within the FPGA",
        ("noc",),
    ),
    Page("network", "Figures of a node in fabric", "area and clock", ("network",)),
    Page("boards", "Figures of boards", "clock and area of bitstreams, and what is done for each family", ("boards",)),
    Page("nodes", "Figures of replays and live nodes", "latencies and throughput", ("replay", "live", "resize")),
    Page("codec", "Figures of the codec", "the time of encoding and decoding in Python", ("codec",)),
    Page("studio", "Figures of firm studio", "how fast the page is", ("studio",)),
)
_HEADINGS = {
    "area": "Area",
    "manager": "Area of Manager and schedulers",
    "timing": "Timing",
    "peers": "Peers",
    "use": "Channel use",
    "passing": "Messages with arrays",
    "inner_topics": "Topics within the FPGA",
    "cycles": "Cycles",
    "fuzz": "Fuzzing",
    "loops": "Combinational loops",
    "images": "Images",
    "links": "Links and crossings",
    "applications": "Applications",
    "kernels": "Kernels",
    "noc": "Networks on chip",
    "network": "ROS 2 by Ethernet",
    "boards": "Bitstreams",
    "systems": "Systems",
    "builds": "Builds",
    "actions": "Cached steps",
    "simulators": "Simulators",
    "store": "Store",
    "replay": "Replay",
    "live": "Live nodes",
    "resize": "Resize, a replica",
    "codec": "Codec",
    "studio": "The page",
}
_METHODS = {
    "area": f"""LUT and FF are counted after `ghdl --synth --out=verilog` and Yosys' `{yosys.SYNTHESIS}`. LUT counts
        the cells LUT1 to LUT6 and all inverters, except inverters of resets, because a slice contains these. FF
        counts the cells FDRE, FDSE, FDCE and FDPE. A design with a latch fails. The dissertation's values are LUT/FF
        reported by Vivado for an UltraScale+.""",
    "manager": "LUT and FF are counted as in [Area](converters.md#area).",
    "timing": f"""The tables list the clock frequency that all paths meet after Yosys' `{nextpnr.SYNTHESIS}` and
        nextpnr (`{nextpnr.DEVICE}`), in a harness with registers at all ports. MHz is the median of the seeds of the
        placement, {", ".join(map(str, nextpnr.SEEDS))} unless fewer are listed. LUT4 and FF do not include the harness;
        a carry cell counts as the two LUT4 that it occupies.
        `make bench BENCH='timing --row "Image.* 64 bits"'` measures only the rows whose names match. A design that is
        unchanged since its last measurement is not placed again.""",
    "peers": """Each part has the same ports and sizes in every library. LUT, FF and MHz are measured as in
        [Timing](timing.md#timing). `make bench BENCH=peers VERILOG_AXIS=DIR OPEN_LOGIC=DIR` names the folders with
        [verilog-axis](https://github.com/alexforencich/verilog-axis) and
        [Open Logic](https://github.com/open-logic/open-logic).""",
    "use": "The beats are counted in the cycle-exact models of the schedulers.",
    "passing": """The message side of a subscriber is wired to the publisher of the same message. Neither the source of
        frames nor their sink pauses. GHDL simulates both, and the cycles are counted.""",
    "inner_topics": """Topics [within the FPGA](../reference/inner-topics.md) are compared with
        the same topics by a host. GHDL simulates both.""",
    "cycles": "Verilator simulates the netlist of `ghdl --synth`, and the cycles are counted.",
    "fuzz": """Correct and broken frames are sent in random order to a subscriber's stream, in a simulation of the
        netlist. Every correct frame must be delivered unchanged. Each broken frame must cause one frame_error and must
        not be delivered. Whole systems are fuzzed in the same way.
        `make bench BENCH="fuzz --row 'system of 64 bits'"` measures one of them.""",
    "loops": """GHDL's netlist is searched bit by bit, as [`lint`](../reference/netlist.md) does, and by two other
        programs. `make bench BENCH="loops --row 'noetic.* 64 bits'"` measures some rows.""",
    "images": """The accelerators of specs/image_pipeline and specs/sobel are measured on their own: LUT/FF as in
        [Area](converters.md#area), and cycles as in [Cycles](converters.md#cycles).""",
    "links": "LUT and FF are counted as in [Area](converters.md#area).",
    "applications": f"""Each of the [demo systems](../reference/applications.md) is measured as a whole, with its
        streams as ports, as in [Area](converters.md#area); [another page](kernels.md) lists those in Python. Yosys
        runs `{yosys.ECP5.synthesis}` for ECP5 and `{yosys.ICE40.synthesis}` for iCE40 UltraPlus. The targets `synth_*`
        run the same commands with the installed Yosys.""",
    "kernels": """The [demo systems](../reference/applications.md) with `type: Python`, and functions in
        tools/bench/kernels, are compiled with one operator of each kind, or with as many as their `latency` needs
        ([Accelerators in Python](../reference/python.md)). The entity of each is measured without converters. LUT4, FF
        and MHz are measured as in [Timing](timing.md#timing). `make bench BENCH='kernels --row pid'` measures only
        the rows whose names match. `HOLOSO=PYTHON` names a Python with
        the package holoso, for the second table.""",
    "noc": """LUT4, FF and MHz are measured as in [Timing](timing.md#timing). Throughput and latency are those of a
        cycle model, which has the handshakes of the [hardware](../../cores/noc/README.md) in every cycle.
        `make bench BENCH='noc --row router'` measures only the rows whose names match.""",
    "network": f"""LUT4, FF and MHz are measured as in [Timing](timing.md#timing), with nextpnr's
        `{network.DEVICE}`.""",
    "boards": f"""`make bench BENCH='boards --row obstacle'` measures only the rows whose names match. It installs
        nothing: the extras {", ".join(OPEN_FLOWS)} have the programs, except Debian's Yosys.""",
    "systems": "The table lists the time to check and generate a large system.",
    "builds": "The table lists the time to generate many cores.",
    "actions": """The table lists the time of commands whose [steps are cached](../reference/actions.md).""",
    "simulators": """The system of specs/quat2euler, with converters, Manager and accelerator, is connected to the
        simulated host. Frames, stalls and received bytes are the same in every simulator.""",
    "store": "The tables list the number of cores that a second run of FuseSoC generates, and the time of this run.",
    "replay": "`firm replay` replays bags that rosbags has written. rosbags also reads the recorded bags.",
    "live": """[`firm live`](../how-to/run-live.md) runs as a node of a running ROS.
        `make bench BENCH="live --row 'Images'"` measures only the tables whose titles match.""",
    "resize": "[specs/resize](../../specs/resize/README.md) is a replica of RobotPerf's benchmark a5, resize.",
    "codec": """[`codec`](../how-to/use-python.md) is compared with other codecs for Python. One of them is an
        extra package: `pip install mcap-ros2-support-fast`.""",
    "studio": "A browser opens [the page](../how-to/studio.md) and edits a system.",
}
_INTRODUCTION = """# {title}

For readers who compare designs, versions or tools.
After reading it, you can look up {subject}.

`make bench BENCH='{parts}'` writes this page.
[Figures](index.md) explains the terms in the tables.
"""
_UNMEASURED = "None of these figures has been measured yet."


def parts() -> tuple[str, ...]:
    """The parts of the bench, in order."""
    return tuple(_HEADINGS)


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row that the pages must hold, by the title of the table."""
    modules = (
        area,
        manager,
        timing,
        use,
        passing,
        inner_topics,
        cycles,
        fuzz,
        fuzz_systems,
        loops,
        images,
        links,
        applications,
        kernels,
        noc,
        network,
        bitstreams,
        peers,
        systems,
        builds,
        actions,
        simulators,
        store,
        replay,
        live,
        resize,
        codec,
    )
    return {title: rows for module in modules for title, rows in module.keys().items()}


def section(part: str, tables: Sequence[Table]) -> str:
    """The text of a part: heading, method, versions, tables."""
    body = "\n".join(str(table) for table in tables)
    is_measured = any(row[-1] != NOT_MEASURED for table in tables for row in table.rows)
    measured = f"These figures were measured with {_versions(part)}." if is_measured else _UNMEASURED
    return f"## {_HEADINGS[part]}\n\n{filled(_METHODS[part])}\n\n{filled(measured)}\n\n{body}"


def write(sections: Mapping[str, str]) -> None:
    """Put sections in the place of those of the same part; the others stay."""
    for page in PAGES:
        file = FOLDER / f"{page.name}.md"
        before = file.read_text(encoding="utf-8") if file.is_file() else ""
        known = {part: _section_of(before, _HEADINGS[part]) for part in page.parts} | dict(sections)
        introduction = _INTRODUCTION.format(title=page.title, subject=page.subject, parts=" ".join(page.parts))
        ordered = (known[part] for part in page.parts)
        file.write_text("\n".join([introduction, *filter(None, ordered)]), encoding="utf-8")


def written() -> str:
    """The text of all pages."""
    files = (FOLDER / f"{page.name}.md" for page in PAGES)
    return "\n".join(file.read_text(encoding="utf-8") for file in files if file.is_file())


def _section_of(text: str, heading: str) -> str:
    found = re.search(rf"^## {heading}\n.*?(?=\n^## |\Z)", text, re.MULTILINE | re.DOTALL)
    return found[0] if found else ""


def _versions(part: str) -> str:
    if part in ("systems", "store"):
        packages = ["rosbags", *(["fusesoc"] if part == "store" else [])]
        return ", ".join([f"Python {platform.python_version()}", *map(_package, packages)])
    if part == "actions":
        tools = [f"Python {platform.python_version()}", _package("fusesoc"), *map(_first_line, ("ghdl", "verilator"))]
        return ", ".join([*tools, *simulators.versions()])
    if part == "builds":
        return f"Python {platform.python_version()}, {_package('fusesoc')} and two processors"
    if part in ("loops", "passing", "inner_topics"):
        programs = ("ghdl", "yosys", "verilator") if part == "loops" else ("ghdl",)
        return ", ".join([*map(_first_line, programs), _package("rosbags")])
    if part in ("use", "codec"):
        others = codec.versions() if part == "codec" else []
        return ", ".join([f"Python {platform.python_version()}, NumPy {metadata.version('numpy')}", *others])
    tools = [_first_line("ghdl"), f"Python {platform.python_version()}"]
    more = {"live": live.versions, "resize": live.versions, "simulators": simulators.versions}
    if part == "boards":
        tools += bitstreams.versions()
    elif part == "images":
        tools += [_first_line("verilator"), f"{yowasp.PACKAGE} {yowasp.version()}"]
    elif part in more:
        tools += [_first_line("verilator"), *more[part]()]
    elif part in ("area", "manager", "timing", "kernels", "noc", "network", "peers", "links", "applications"):
        tools.append(f"{yowasp.PACKAGE} {yowasp.version()}")
        tools += (
            [f"{nextpnr.PACKAGE} {nextpnr.version()}"]
            if part in ("timing", "kernels", "noc", "network", "peers")
            else []
        )
        tools += peers.versions() if part == "peers" else []
    else:
        tools += [_first_line("verilator"), f"rosbags {metadata.version('rosbags')}"]
    return ", ".join(tools)


def _package(name: str) -> str:
    return f"{name} {metadata.version(name)}"


def _first_line(program: str) -> str:
    """`GHDL 2.0.0`, `Verilator 5.006`."""
    output = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    name, version, *_ = output.split()
    return f"{name} {version}"
