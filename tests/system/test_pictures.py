"""What can be shown of a system: its diagram, its lines, and the grammar as a JSON Schema."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import jsonschema
import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.system.views.diagram import THEMES, dark_style, diagram
from fusesoc_firm.system.views.page import page
from fusesoc_firm.system.views.report import Report, report
from fusesoc_firm.system.written.specification import Specification
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.yaml_schema import json_schema
from fusesoc_firm.tools.pictures import picture
from tests.system.svg_texts import faults
from tests.system.systems import LIBRARIES, accelerator, converter, derived, instance, specification

ROOT = Path(__file__).resolve().parents[2]
SPECS = [path for path in sorted(ROOT.glob("specs/*/*.yaml")) if "blocks:" in path.read_text(encoding="utf-8")]
BLOCKS = (
    converter("sub", "subscriber", "Point", "acc", "copy")
    + instance("acc", "mix", "pub")
    + converter("pub", "publisher", "Vector3")
    + converter("copy", "publisher", "Point")
    + converter("image_in", "subscriber", "sensor_msgs/Image", "image_out")
    + converter("image_out", "publisher", "sensor_msgs/Image")
)
TEXT = specification(BLOCKS, accelerator("mix", "Point", "Vector3"))

needs_dot = pytest.mark.skipif(not shutil.which("dot"), reason="no dot; make test installs Graphviz")


def test_the_diagram_has_every_block_and_connection(tmp_path: Path) -> None:
    text = diagram(derived(tmp_path, TEXT))
    edges = re.findall(r'"block (\w+)" -> "block (\w+)"', text)
    assert edges == [("sub", "acc"), ("sub", "copy"), ("acc", "pub"), ("image_in", "image_out")]
    for what in ("<b>/sub</b><br/>geometry_msgs/Point", "192 bits", "mix (VHDL)", "id 2", "8-bit streams", "3 streams"):
        assert what in text, what


def test_the_diagram_has_times_clocks_pins_and_queues() -> None:
    text = diagram(load_system(ROOT / "specs" / "multi_type" / "multi_type.yaml", LIBRARIES).system)
    for what in ("clk 100 MHz", "100 Hz", "30 Hz<br/>deadline 20 ms", "<b>Manager</b><br/>fixed<br/>priority<br/>"):
        assert what in text, what
    text = diagram(load_system(ROOT / "specs" / "mobile_robot" / "mobile_robot.yaml", LIBRARIES).system)
    assert "pins in: enc_a(4), enc_b(4)<br/>pins out: pwm(4), dir(4), enc_errors(32)<br/>pins out: stalled(4)" in text


@needs_dot
@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_a_picture_of_an_application_is_legible_at_1200_pixels(path: Path) -> None:
    system = load_beside(path).system
    assert faults(picture(diagram(system), "svg", dark_style()), 1200) == []


@needs_dot
def test_illegible_pictures_are_found() -> None:
    edge = 'a -> b [label="in the way", labelangle=0, labeldistance=3, taillabel="in the way"]'
    assert faults(picture(f"digraph {{ rankdir=LR; {edge} }}", "svg"), 1200)
    assert faults(picture('digraph { a [label="far too wide", fixedsize=true, width=0.2] }', "svg"), 1200)


@needs_dot
def test_a_picture_has_colours_for_dark_pages() -> None:
    system = load_system(ROOT / "specs" / "multi_type" / "multi_type.yaml", LIBRARIES).system
    svg = picture(diagram(system), "svg", dark_style()).decode()
    assert "prefers-color-scheme: dark" in svg
    assert all(f'class="node {name}"' in svg for name in ("host", "manager", "converter", "accelerator"))
    assert all(f".{name} " in svg for name in THEMES["dark"].fills)
    assert THEMES["dark"].paper in diagram(system, "dark")


@needs_dot
def test_the_picture_is_the_same_each_time(tmp_path: Path) -> None:
    found = picture(diagram(derived(tmp_path, TEXT)), "svg")
    assert found == picture(diagram(derived(tmp_path, TEXT)), "svg")
    labels = [element.text for element in ET.fromstring(found).iter() if element.tag.endswith("}text")]
    assert {"/sub", "acc", "mix (VHDL)", "sensor_msgs/Image"} <= set(labels)


def test_missing_graphviz_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="apt install graphviz"):
        picture(diagram(derived(tmp_path, TEXT)), "svg")


def test_lines_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "spec.yaml"
    path.write_text(f"# a comment\n\n{TEXT}", encoding="utf-8")
    (tmp_path / "acc.vhd").touch()
    found = report(path, load_system(path, LIBRARIES))
    assert found.written == len(TEXT.splitlines())
    assert 0 < found.configuration < found.generated == found.configuration + found.files
    assert found.ratio == found.generated / found.written


def test_a_report_is_a_table() -> None:
    found = Report("robot", written=4, configuration=1, files=9)
    assert (found.generated, found.ratio) == (10, 2.5)
    assert str(found).splitlines()[-1].split() == ["generated", "for", "each", "line", "written", "2.50"]


@needs_dot
def test_a_page_has_diagram_ports_schedule_and_coverage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "report.html"
    assert main(["system", "report", str(ROOT / "specs/multi_type/multi_type.yaml"), "--html", str(output)]) == 0
    assert capsys.readouterr().out == f"{output}\n"
    text = output.read_text(encoding="utf-8")
    assert "<svg" in text and "<?xml" not in text and "No build for a board" in text
    for row in (
        "<td>in</td><td>twist_in</td><td>/twist_in</td><td>geometry_msgs/TwistStamped</td>",
        "<td>twist</td><td>in_twist_linear_x</td><td>in</td><td>64</td>",
        "<td>twist</td><td>out_twist_linear_x</td><td>out</td><td>64</td>",
        "<td>image_out</td><td>3333333</td><td>2000000</td>",
    ):
        assert row in text, row


def test_a_page_has_resources_and_constant_fields(tmp_path: Path) -> None:
    report = tmp_path / "icebreaker" / "report.json"
    report.parent.mkdir()
    clock = '{"clk": {"achieved": 29.34, "constraint": 12.0}}'
    cells = '{"LC": {"used": 1226, "available": 5280}, "DSP": {"used": 0, "available": 8}}'
    report.write_text(f'{{"fmax": {clock}, "utilization": {cells}}}', encoding="utf-8")
    messages = [("sub", {"x": 1, "y": {"z": 2}}), ("sub", {"x": 1, "y": {"z": 3}})]
    text = page(derived(tmp_path, TEXT), "<svg/>", [report], messages)
    assert "<td>icebreaker</td><td>clock</td><td>29.3 MHz</td><td>12.0 MHz required</td>" in text
    assert "<td>LC</td><td>1226</td><td>of 5280</td>" in text and "DSP" not in text
    assert "<td>sub</td><td>2</td><td>1 of 2</td><td>x</td>" in text


SCHEMA = json_schema(Specification, "title")


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$ref"] == "#/$defs/Specification"


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_good_specifications_keep_to_the_schema(path: Path) -> None:
    jsonschema.validate(yaml.safe_load(path.read_text(encoding="utf-8")), SCHEMA)


def test_only_software_may_have_no_sources() -> None:
    for kind, is_right in (("ROS-SW", True), ("VHDL", False), ("HLS", False)):
        text = TEXT.replace("type: VHDL, sources: [acc.vhd]", f"type: {kind}")
        assert jsonschema.Draft202012Validator(SCHEMA).is_valid(yaml.safe_load(text)) is is_right


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("project:", "projekt:"),
        ("name: robot", "label: robot"),
        ("mode: publisher", "mode: sender"),
        ("type: VHDL", "type: Chisel"),
        ("sources: [acc.vhd]", "sources: []"),
        ("{name: robot}", "{name: robot, width: wide}"),
        ("{name: robot}", "{name: robot, width: 24}"),
    ],
)
def test_bad_specifications_do_not(before: str, after: str) -> None:
    assert before in TEXT
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(yaml.safe_load(TEXT.replace(before, after)), SCHEMA)
