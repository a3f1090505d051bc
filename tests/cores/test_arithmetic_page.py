"""docs/reference/arithmetic.md: the architecture of the page works in a new project."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.cli import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "arithmetic.md"
# The alarm begins below 0.2, ends above 0.25, and stays without a number.
MODEL = """\
import numpy

alarm = False


def respond(subscriber, message):
    global alarm
    level = numpy.float32(message["percentage"])
    alarm = bool(level < numpy.float32(0.2) or (alarm and not level > numpy.float32(0.25)))
    return [("pub", {"data": alarm})]
"""
LEVELS = (1.0, 0.2, 0.19, 0.22, 0.25, ".nan", 0.26, ".nan", 0.22, 0.1, -1.0, 0.3)


@pytest.mark.one_in(2)
def test_the_architecture_with_a_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    types = ["--in", "sensor_msgs/BatteryState", "--out", "std_msgs/Bool", "--include", "percentage"]
    assert main(["init", "battery", *types]) == 0
    project = tmp_path / "battery"
    monkeypatch.chdir(project)
    found = re.search(
        r"^    architecture rtl of battery.*?^    end architecture;$", PAGE.read_text(), re.MULTILINE | re.DOTALL
    )
    assert found
    (source,) = (project / "rtl").glob("*.vhd")
    text = source.read_text()
    begin = re.search(r"^architecture ", text, re.MULTILINE)
    assert begin
    source.write_text(text[: begin.start()] + re.sub("^    ", "", found[0], flags=re.MULTILINE) + "\n")
    (project / "model.py").write_text(MODEL)
    (project / "stimuli.yaml").write_text("".join(f"- {{sub: {{percentage: {level}}}}}\n" for level in LEVELS))
    assert main(["sim", "--quiet"]) == 0
