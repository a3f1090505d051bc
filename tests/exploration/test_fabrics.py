"""The ways of topics within the FPGA: their figures, the map of an exchange, and the command that shows them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.exploration.fabric_map import FabricMap
from fusesoc_firm.exploration.fabrics import Fabric, Traffic, fabrics, traffic
from fusesoc_firm.exploration.fabrics_text import map_text
from fusesoc_firm.noc.estimate import delay
from fusesoc_firm.noc.model import Frame, arrivals
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.diagnostics import InputError

Captured = pytest.CaptureFixture[str]
POSE = {"middleware": "ROS2", "message": "geometry_msgs/Pose"}
# The bits of a pose: seven float64.
BITS = 448


def converter(name: str, mode: str, topic: str, outgoing: str = "", **keys: Any) -> dict[str, Any]:
    ways = {"outgoing": [{"name": outgoing}]} if outgoing else {}
    return {"name": name, **POSE, "mode": mode, "topic": topic, **keys, **ways}


def accelerator(name: str) -> list[dict[str, Any]]:
    """An accelerator with its publisher, which sends only to blocks of the system."""
    return [
        {"name": name, "type": "passing", "outgoing": [{"name": f"{name}_out"}]},
        converter(f"{name}_out", "publisher", f"from_{name}", deliver="fabric"),
    ]


def spec(folder: Path, fabric: str, *, has_topics: bool = True) -> Path:
    """Edges are read by two accelerators, whose objects are tracked."""
    (folder / "acc.vhd").touch()
    types = [
        {"name": "passing", "type": "VHDL", "sources": "acc.vhd", "interface": {"input": [POSE], "output": [POSE]}}
    ]
    blocks = [converter("camera", "subscriber", "camera", "edges" if has_topics else "done")]
    if has_topics:
        for name in ("edges", "regions", "corners", "tracker"):
            blocks += accelerator(name)
        blocks += [
            converter("regions_in", "subscriber", "from_edges", "regions"),
            converter("corners_in", "subscriber", "from_edges", "corners"),
            converter("tracker_in", "subscriber", "objects", "tracker"),
            converter("track_in", "subscriber", "from_tracker", "done"),
        ]
        for block in blocks:
            if block["name"] in ("regions_out", "corners_out"):
                block["topic"] = "objects"
    blocks.append(converter("done", "publisher", "done"))
    content = {"project": {"name": "robot", "fabric": fabric}, "accelerators": types, "blocks": blocks}
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


def found(path: Path) -> dict[str, Fabric]:
    return {item.name: item for item in fabrics(load_beside(path))}


def test_the_ways_of_a_system(tmp_path: Path) -> None:
    ways = found(spec(tmp_path, "auto"))
    assert [*ways] == ["wires", "crossbar", "mesh", "chain", "ring"]
    # Two publishers of one topic meet in a merge, with one LUT for each bit.
    assert (ways["wires"].lut, ways["wires"].cycles, ways["wires"].interval) == (BITS + 12, 1, 1)
    crossbar = ways["crossbar"].data()
    assert (crossbar["routers"], crossbar["turns"], crossbar["hops"]) == (1, 5, 1.0)
    assert crossbar["interval"] == BITS // 8
    # The edges are sent to each of their two readers.
    assert ways["mesh"].interval == 2 * BITS // 8
    assert all(way.lut > ways["wires"].lut for name, way in ways.items() if name != "wires")


def test_the_chosen_topology_is_shown_even_if_it_is_too_large(tmp_path: Path) -> None:
    assert "concentrated_mesh" in found(spec(tmp_path, "concentrated_mesh"))


def test_a_system_without_topics_has_only_wires(tmp_path: Path) -> None:
    assert [*found(spec(tmp_path, "auto", has_topics=False))] == ["wires"]


@pytest.mark.parametrize("fabric", ["crossbar", "mesh", "chain", "ring"])
def test_a_lone_frame_takes_the_cycles_of_the_model(tmp_path: Path, fabric: str) -> None:
    network = found(spec(tmp_path, fabric))[fabric].network
    assert network is not None
    for number, flow in enumerate(network.flows):
        for sink in flow.sinks:
            (cycle,) = {item.cycle for item in arrivals(network, [Frame(0, number, 9)], 99) if item.sink == sink}
            # An output may already be at the input of the frame.
            routers = len(network.ways[flow.source, sink])
            assert routers + 8 <= cycle <= delay(network, flow, sink) + 8


def test_traffic_is_limited_by_the_busiest_link(tmp_path: Path) -> None:
    """Two publishers share the way to the tracker; in a mesh, the edges are sent twice."""
    ways = found(spec(tmp_path, "auto"))
    beats = BITS // 8
    crossbar, mesh = traffic(ways["crossbar"]), traffic(ways["mesh"])
    assert crossbar.rate == pytest.approx(1000 / (2 * beats), rel=0.05)
    assert mesh.rate <= crossbar.rate
    for result in (crossbar, mesh):
        assert beats < result.mean < result.worst < 20 * beats


def test_traffic_of_wires_is_that_of_the_largest_merge(tmp_path: Path) -> None:
    """Two publishers take turns; without a merge, a message passes in the cycle in which it is due."""
    wires = traffic(found(spec(tmp_path, "auto"))["wires"])
    assert wires.rate == pytest.approx(500)
    assert 0 < wires.mean < wires.worst < 10
    assert traffic(Fabric("wires")) == Traffic(1000, 0, 0)


def test_the_map_of_a_grid_and_of_others(tmp_path: Path) -> None:
    mesh = found(spec(tmp_path, "mesh"))["mesh"].exchange
    crossbar = found(spec(tmp_path, "mesh"))["crossbar"].exchange
    assert mesh is not None
    assert crossbar is not None
    lines = [*map_text(FabricMap(mesh))]
    assert sum(line.count("[") for line in lines) == 6
    assert all(any(block in line for line in lines) for block in ("edges", "regions", "corners", "tracker", "done"))
    assert "--" in lines[0]
    assert [*map_text(FabricMap(crossbar))] == ["router 0: edges, regions, corners, tracker, done"]


def out(capsys: Captured, *arguments: object) -> str:
    capsys.readouterr()
    assert main([*map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_show(tmp_path: Path, capsys: Captured) -> None:
    text = out(capsys, "fabric", "show", spec(tmp_path, "mesh"))
    assert "topic /objects: regions_out, corners_out -> tracker_in within the FPGA by the exchange, a mesh of" in text
    assert "\n*  mesh " in text
    assert "\n   wires " in text
    assert "a mesh of 3 x 2 with 6 routers and 5 endpoints\n[" in text
    assert max(map(len, text.splitlines()[4:])) <= 100


def test_show_for_programs(tmp_path: Path, capsys: Captured) -> None:
    data = json.loads(out(capsys, "fabric", "show", spec(tmp_path, "crossbar"), "--json"))
    assert data["fabric"] == "crossbar"
    assert [item["fabric"] for item in data["ways"]] == ["wires", "crossbar", "mesh", "chain", "ring"]
    assert data["Exchange"]["topology"] == "crossbar"
    data = json.loads(out(capsys, "fabric", "show", spec(tmp_path, "auto"), "--json"))
    assert data["fabric"] == "wires"
    assert "Exchange" not in data


def test_show_without_topics(tmp_path: Path, capsys: Captured) -> None:
    assert out(capsys, "fabric", "show", spec(tmp_path, "auto", has_topics=False)) == "no topic is within the FPGA\n"


def test_the_map_is_a_picture(tmp_path: Path, capsys: Captured) -> None:
    picture = tmp_path / "map.dot"
    out(capsys, "fabric", "show", spec(tmp_path, "mesh"), "--map", picture)
    text = picture.read_text(encoding="utf-8")
    assert "a mesh of 3 x 2" in text
    assert text.count("rank=same") == 2
    assert "tracker" in text


def test_bench(tmp_path: Path, capsys: Captured) -> None:
    path = spec(tmp_path, "mesh")
    lines = out(capsys, "fabric", "bench", path).splitlines()
    assert [line.lstrip("* ").split()[0] for line in lines[2:]] == ["way", "wires", "crossbar", "mesh", "chain", "ring"]
    assert lines[5].startswith("*  mesh")
    data = json.loads(out(capsys, "fabric", "bench", path, "--json"))
    assert [item["fabric"] for item in data] == ["wires", "crossbar", "mesh", "chain", "ring"]
    assert out(capsys, "fabric", "bench", spec(tmp_path, "auto", has_topics=False)) == "no topic is within the FPGA\n"


def test_wires_have_no_map(tmp_path: Path, capsys: Captured) -> None:
    assert main(["fabric", "show", str(spec(tmp_path, "auto")), "--map", str(tmp_path / "map.svg")]) == 1
    assert "--map draws the routers of an exchange" in capsys.readouterr().err


def test_a_topology_that_may_deadlock_is_not_possible(tmp_path: Path, capsys: Captured) -> None:
    """Six flows between three blocks use all links of a ring."""
    path = spec(tmp_path, "auto")
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    blocks = [converter("camera", "subscriber", "camera", "done"), converter("done", "publisher", "done")]
    for name in "abc":
        blocks += accelerator(name)
        blocks += [
            converter(f"{other}_to_{name}", "subscriber", f"from_{other}", name, queue=2)
            for other in "abc"
            if other != name
        ]
    interface = content["accelerators"][0]["interface"]
    interface["input"] = [POSE, POSE]
    path.write_text(yaml.safe_dump({**content, "blocks": blocks}, sort_keys=False), encoding="utf-8")
    text = out(capsys, "fabric", "show", path)
    assert "ring: not possible: messages may wait for each other in the routers" in text
    content["project"]["fabric"] = "ring"
    path.write_text(yaml.safe_dump({**content, "blocks": blocks}, sort_keys=False), encoding="utf-8")
    with pytest.raises(InputError, match=r"router 0 to router 1 -> "):
        load_beside(path)
