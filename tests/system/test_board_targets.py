"""The boards of a core's targets, and those among them that a system fits."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.system.boards.board import FOLDER, read_board
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.scaffold.board_targets import boards_of, fits, placed
from fusesoc_firm.system.views.show import default_lengths
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import converter, specification

SPECS = Path(__file__).resolve().parents[2] / "specs"
OPEN = {"crosslink_nx_evn", "gatemate_a1_evb", "icebreaker", "step_mxo2", "tangnano9k", "ulx3s"}
VENDORS = {"kr260", "quartus", "zcu104", "zynq7000"}


def offered(project: str, folder: Path) -> set[str]:
    """The boards of obstacle's core that another system fits."""
    spec = folder / "robot.yaml"
    ways = converter("sub", "subscriber", "Point", "pub", ros="ROS2") + converter(
        "pub", "publisher", "Point", ros="ROS2"
    )
    spec.write_text(specification(ways, project=project), encoding="utf-8")
    loaded = load_beside(spec)
    return {
        name
        for name, board in boards_of(read_core(SPECS / "obstacle" / "obstacle.core")).items()
        if fits(loaded, board)
    }


def test_a_core_has_the_boards_of_its_targets() -> None:
    assert boards_of(read_core(SPECS / "obstacle" / "obstacle.core")).keys() == OPEN | VENDORS
    found = boards_of(read_core(SPECS / "obstacle" / "obstacle_node.core"))
    assert found["ulx3s_w5500"].loader == "ulx3s"


@pytest.mark.parametrize(
    ("more", "boards"),
    [
        ("", OPEN | VENDORS),
        (", idBytes: 2", set()),
        (", scheduler: fixed_priority_preemptive", VENDORS),
    ],
)
def test_a_board_is_offered_if_the_system_fits_it(tmp_path: Path, more: str, boards: set[str]) -> None:
    assert offered(f"{{name: robot{more}}}", tmp_path) == boards


def test_the_link_of_a_board_shortens_messages_without_bounds(tmp_path: Path) -> None:
    spec = tmp_path / "robot.yaml"
    ways = converter("sub", "subscriber", "geometry_msgs/Polygon", "pub", ros="ROS2") + converter(
        "pub", "publisher", "geometry_msgs/Polygon", ros="ROS2"
    )
    spec.write_text(specification(ways, project="{name: robot}"), encoding="utf-8")
    loaded = load_beside(spec)
    sentence = "{}: geometry_msgs/Polygon has no bounds and no 'maxLength'; payloads of more than {} bytes are refused"
    with_link = " (of more than 2000 on a board with UART or SPI)"
    assert default_lengths(loaded.system) == [sentence.format("sub", 65536) + with_link, sentence.format("pub", 65536)]
    for board, most in (("ulx3s", "2000"), ("zcu104", "65536")):
        first, second = default_lengths(placed(loaded, read_board(board)))
        assert first.removesuffix(with_link) == sentence.format("sub", most)
        assert second == sentence.format("pub", 65536)


def test_a_board_of_the_project_is_one_of_its_core(tmp_path: Path) -> None:
    """Its target may have a name of its own, and the generator's call may be an instance of its own."""
    core = tmp_path / "robot.core"
    text = (FOLDER / "ulx3s.yaml").read_text(encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(text.replace("loader: ulx3s\n", ""), encoding="utf-8")
    text = "CAPI=2:\nname: a:b:c\ngenerate:\n  placed: {generator: far, parameters: {spec: a.yaml, board: mine.yaml}}\n"
    core.write_text(
        f"{text}targets:\n  first: {{generate: [placed]}}\n  other: {{generate: other}}\n", encoding="utf-8"
    )
    (found,) = boards_of(read_core(core)).items()
    assert (found[0], found[1].name, found[1].loader) == ("first", "mine", None)
    (tmp_path / "mine.yaml").unlink()
    with pytest.raises(InputError, match=r"unknown board 'mine\.yaml'"):
        boards_of(read_core(core))
