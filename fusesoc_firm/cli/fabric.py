"""`firm fabric`: the ways of topics within the FPGA."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_json, add_sources, add_spec, command, load, print_json
from fusesoc_firm.text.diagnostics import fail


def add_fabric(commands: Any) -> None:
    """Declare the command and its actions."""
    fabric = command(commands, "fabric", "show the ways of topics within the FPGA", "firm fabric show robot.yaml")
    actions = fabric.add_subparsers(title="actions", metavar="ACTION", required=True)
    show = command(
        actions,
        "show",
        "show the ways of topics within the FPGA, what other ways would cost, and the map of the exchange",
        "firm fabric show robot.yaml --map robot.svg",
        _show,
    )
    add_spec(show)
    add_sources(show)
    show.add_argument(
        "--map", type=Path, metavar="F.svg", help="write the map of the exchange; .png, .pdf and .dot are legal, too"
    )
    add_json(show)
    bench = command(
        actions,
        "bench",
        "measure each exchange with the messages of all topics, by a model of every cycle",
        "firm fabric bench robot.yaml",
        _bench,
    )
    add_spec(bench)
    add_sources(bench)
    add_json(bench)


def _bench(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.exploration.fabrics import fabrics, traffic
    from fusesoc_firm.exploration.fabrics_text import traffic_text

    loaded = load(arguments)
    found = fabrics(loaded)
    if arguments.json:
        print_json([{"fabric": item.name, **asdict(traffic(item))} for item in found if not item.fault])
        return
    if len(found) == 1:
        print("no topic is within the FPGA")
        return
    print("rate: messages in 1,000 cycles from the slowest publisher, if all publishers always have one")
    print("mean, worst: cycles of a message at half of this rate, at random times")
    print("\n".join(traffic_text(found, str(loaded.specification.project.fabric))))


def _show(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.exploration.fabric_map import FabricMap
    from fusesoc_firm.exploration.fabrics import fabric_of, fabrics, fabrics_data
    from fusesoc_firm.exploration.fabrics_text import fabrics_text, map_picture, map_text
    from fusesoc_firm.exploration.worst_case import worst_times
    from fusesoc_firm.exploration.worst_case_text import worst_times_text
    from fusesoc_firm.system.views.inner_topics import topics_description, ways_of_topics
    from fusesoc_firm.tools.pictures import check_picture, draw

    check_picture(arguments.map, None)
    loaded = load(arguments)
    drawn = FabricMap(loaded.system.exchange) if loaded.system.exchange else None
    found, times = fabrics(loaded), worst_times(loaded)
    if arguments.map:
        if not drawn:
            fail("--map draws the routers of an exchange", hint="add 'fabric: crossbar' or another one to 'project'")
        draw(map_picture(loaded.system.name, drawn), arguments.map, None)
    if arguments.json:
        worst = [item.data() for item in times]
        print_json({**fabrics_data(loaded, found), "worstCase": worst, **topics_description(loaded.system)})
        return
    for line in ways_of_topics(loaded.system) or ["no topic is within the FPGA"]:
        print(line)
    if len(found) > 1:
        print(f"\nways, estimated for an ECP5, with streams of {loaded.system.width} bits; *: the specification's")
        print("\n".join(fabrics_text(found, fabric_of(loaded))))
    if loaded.system.inner_topics:
        print("\n".join(worst_times_text(times)))
    if drawn:
        print(f"\n{drawn.title}")
        print("\n".join(map_text(drawn)))
