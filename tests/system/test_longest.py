"""The longest payload of each channel: the message's bounds, the block's `maxLength`, or a default that check names."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.frame.length import DEFAULT_LONGEST
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.system.views.show import default_lengths
from tests.system.systems import LIBRARIES, converter, derived, specification

SPECS = Path(__file__).resolve().parents[2] / "specs"
IMAGE, STRING = "sensor_msgs/Image", "std_msgs/String"


@pytest.mark.parametrize(
    ("project", "longest"),
    [
        ("{name: robot}", DEFAULT_LONGEST),
        ("{name: robot, interconnect: uart, clock: 100 MHz}", 2000),
        ("{name: robot, interconnect: spi}", 2000),
    ],
)
def test_a_link_has_the_limit_of_its_subscribers(tmp_path: Path, project: str, longest: int) -> None:
    """What the link refuses is what check names."""
    blocks = converter("text", "subscriber", STRING, "back") + converter("back", "publisher", STRING)
    system = derived(tmp_path, specification(blocks, project=project))
    assert system.subscribers[0].max_length == longest
    assert system.link is None or system.link.longest == longest
    assert f"text: {STRING} has no bounds and no 'maxLength'" in default_lengths(system)[0]
    assert f"more than {longest} bytes" in default_lengths(system)[0]


def test_a_publisher_sends_what_a_subscriber_may_be(tmp_path: Path) -> None:
    text = converter("text", "subscriber", STRING, "back") + converter("back", "publisher", STRING)
    image = converter("image", "subscriber", IMAGE, "shown").replace("outgoing", "maxLength: 500000, outgoing")
    shown = converter("shown", "publisher", IMAGE)
    system = derived(tmp_path, specification(text + image + shown))
    assert [item.max_length for item in system.publishers] == [500000, 500000]
    assert [line.split(":")[0] for line in default_lengths(system)] == ["text", "back", "shown"]
    limited = (
        text.replace("publisher", "publisher, maxLength: 70")
        + image
        + shown.replace("outgoing", "buffer: 9000, outgoing")
    )
    system = derived(tmp_path, specification(limited))
    assert [item.max_length for item in system.publishers] == [70, None]


def test_the_shipped_systems_name_their_longest_payloads() -> None:
    """Nothing of them depends on a default. Messages of a system's own are known to its core only."""
    specs = [
        path
        for path in SPECS.glob("*/*.yaml")
        if not path.stem.startswith("stimuli") and not (path.parent / "msg").is_dir()
    ]
    assert specs
    lines = [line for path in specs for line in default_lengths(load_system(path, LIBRARIES).system)]
    assert lines == []


def test_another_subscriber_does_not_raise_a_default(tmp_path: Path) -> None:
    text = converter("text", "subscriber", STRING, "back") + converter("back", "publisher", STRING)
    image = converter("image", "subscriber", IMAGE, "shown").replace("outgoing", "maxLength: 5000, outgoing")
    blocks = text + image + converter("shown", "publisher", IMAGE)
    system = derived(tmp_path, specification(blocks, project="{name: robot, interconnect: spi}"))
    assert [item.max_length for item in system.subscribers] == [2000, 5000]
    assert system.link and system.link.longest == 5000
