"""The XML of a component in each version of the standard."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path, PurePosixPath

import pytest
from lxml import etree

from fusesoc_firm.export.component.interfaces import infer
from fusesoc_firm.export.component.model import Component, Direction, Generic, Port, SourceFile
from fusesoc_firm.export.component.package import Package
from fusesoc_firm.export.ip_xact.package import write_package
from fusesoc_firm.export.ip_xact.writer import STANDARDS, write_component
from tests.export.ip_xact.component_file import YEARS, ComponentFile, read_component

PORTS = [
    Port("clk", Direction.IN),
    Port("rst_n", Direction.IN),
    Port("m_axis_tdata", Direction.OUT, (7, 0)),
    Port("m_axis_tvalid", Direction.OUT),
    Port("m_axis_tready", Direction.IN),
    Port("first", Direction.IN, (0, 0), 1),
    Port("second", Direction.INOUT, (3, 10)),
]
GENERICS = [
    Generic("SIZE", "positive", 12),
    Generic("NAME", "string", 'a "b" <c>'.replace('"', "'")),
    Generic("IS_FAST", "boolean", True),
    Generic("GAIN", "real", 0.5),
    Generic("WIDTH", "natural", 8, is_free=False),
]
# Each type of FuseSoC, with the types of files in each standard; `user:` marks a type that the standard does not know.
TYPES = {
    "vhdlSource": ("vhdlSource", "vhdlSource", "vhdlSource"),
    "vhdlSource-93": ("vhdlSource", "vhdlSource-93", "vhdlSource-93"),
    "vhdlSource-2008": ("user:vhdlSource-2008", "user:vhdlSource-2008", "vhdlSource-2008"),
    "verilogSource-2005": ("verilogSource", "user:verilogSource-2005", "verilogSource-2005"),
    "systemVerilogSource": ("systemVerilogSource",) * 3,
    "xdc": ("user:xdc",) * 3,
}


def component() -> Component:
    files = [SourceFile(PurePosixPath(f"src/{number}.x"), type_, "parts") for number, type_ in enumerate(TYPES)]
    included = SourceFile(PurePosixPath("src/sizes.vh"), "verilogSource", is_include_file=True)
    return Component(
        "me", "robots", "filter", "1.2.3", "A & B", "VHDL", PORTS, infer(PORTS), [*files, included], GENERICS
    )


def written(folder: Path, year: int, item: Component | None = None) -> ComponentFile:
    item = item or component()
    for file in item.files:
        (folder / file.path.name).touch()
    write_package(Package(item, {file.path: folder / file.path.name for file in item.files}), year, folder / "ip")
    return read_component(folder / "ip", year)


@pytest.mark.parametrize("year", YEARS)
def test_what_is_written_is_read_back(tmp_path: Path, year: int) -> None:
    found = written(tmp_path, year)
    # Vivado accepts versions of two numbers.
    assert found.vlnv == ["me", "robots", "filter", "1.2" if year == 2009 else "1.2.3"]
    assert found.text("description") == "A & B"
    assert found.ports == {port.name: (port.direction.value, port.bounds) for port in PORTS}
    assert found.defaults == {"first": 1}
    assert found.interfaces["m_axis"][:2] == ("interface:axis", True)
    assert found.interfaces["rst_n"] == ("signal:reset", False, {"RST": "rst_n"})
    assert found.parameters("clk") == {"ASSOCIATED_BUSIF": "m_axis", "ASSOCIATED_RESET": "rst_n"}
    assert found.parameters("m_axis")["TDATA_NUM_BYTES"] == "1"


@pytest.mark.parametrize("year", YEARS)
def test_types_of_files(tmp_path: Path, year: int) -> None:
    found = written(tmp_path, year)
    read = []
    for file in found.find("file", found.find("fileSets/fileSet")[0])[: len(TYPES)]:
        (kind,) = [*found.find("fileType", file), *found.find("userFileType", file)]
        user = kind.text if kind.tag.endswith("userFileType") else kind.get("user")
        read.append(f"user:{user}" if user else kind.text)
        assert found.text("logicalName", file) == "parts"
    assert read == [types[YEARS.index(year)] for types in TYPES.values()]
    assert found.text("isIncludeFile", found.find("fileSets/fileSet/file")[len(TYPES)]) == "true"


def test_generics_as_vivado_reads_them(tmp_path: Path) -> None:
    """A free generic is a parameter of the user, whose value a procedure copies to the model's."""
    found = written(tmp_path, 2009)
    values = found.find("model/modelParameters/modelParameter/value")
    read = [[value.text, *(word for name, word in value.items() if not name.endswith("id"))] for value in values]
    assert read == [
        ["12", "long", "generated"],
        ["a 'b' <c>", "generated"],
        ["true", "bool", "generated"],
        ["0.5", "float", "generated"],
        ["8", "long", "immediate"],
    ]
    ids = [name for value in values for word, name in value.items() if word.endswith("id")]
    assert ids == [f"MODELPARAM_VALUE.{generic.name}" for generic in GENERICS]
    free = ["SIZE", "NAME", "IS_FAST", "GAIN"]
    assert found.find("parameters/parameter/name/text()") == [*free, "Component_Name"]
    gui = (tmp_path / "ip/xgui/filter_v1_2.tcl").read_text(encoding="utf-8")
    assert [name for name in free if f"proc update_MODELPARAM_VALUE.{name} " in gui] == free
    assert "WIDTH" not in gui


@pytest.mark.parametrize("year", YEARS[1:])
def test_generics_since_2014(tmp_path: Path, year: int) -> None:
    """The module's parameters are expressions of the component's, by their ids."""
    found = written(tmp_path, year)
    ids = {found.text("name", item): item.get("parameterId") for item in found.find("parameters/parameter")}
    (module, _) = found.find("model/instantiations/componentInstantiation")
    values = found.find("moduleParameters/moduleParameter", module)
    assert {found.text("name", item): found.text("value", item) for item in values} == {**ids, "WIDTH": "8"}
    assert found.find("parameters/parameter/value/text()") == ["12", "\"a 'b' <c>\"", "1", "0.5"]


def test_vivado_extensions_are_only_in_2009(tmp_path: Path) -> None:
    found = written(tmp_path, 2009)
    space = {"x": "http://www.xilinx.com"}
    (core,) = found.root.xpath("./*[local-name()='vendorExtensions']/x:coreExtensions", namespaces=space)
    families = core.xpath("x:supportedFamilies/x:family[@x:lifeCycle='Production']/text()", namespaces=space)
    assert {"artix7", "zynq", "zynquplus", "versal"} <= {*families}
    assert core.xpath("x:coreRevision/text()", namespaces=space) == ["3"]
    assert core.xpath("x:taxonomies/x:taxonomy/text()", namespaces=space) == ["/UserIP"]
    ids = [
        value
        for word, value in ((name, text) for item in found.root.iter() for name, text in item.items())
        if word.endswith("}id")
    ]
    assert "BUSIFPARAM_VALUE.M_AXIS.TDATA_NUM_BYTES" in ids
    assert "BUSIFPARAM_VALUE.CLK.ASSOCIATED_BUSIF" in ids
    assert len({*ids}) == len(ids)
    for year in YEARS[1:]:
        assert b"xilinx.com/" not in etree.tostring(written(tmp_path, year).root)
        assert not written(tmp_path, year).find("vendorExtensions")


@pytest.mark.parametrize("year", YEARS)
def test_a_component_without_interfaces_and_generics_is_valid(tmp_path: Path, year: int) -> None:
    bare = replace(component(), interfaces=[], generics=[], description="", files=component().files[:1])
    assert not written(tmp_path, year, bare).interfaces


def test_the_text_depends_on_the_component_alone() -> None:
    texts = {write_component(component(), STANDARDS[2009]) for _ in range(2)}
    assert len(texts) == 1


def test_a_fault_in_the_xml_is_found(tmp_path: Path) -> None:
    """The schema refuses a name of a port that no port has, and an element at a wrong place."""
    wrong = replace(component(), ports=PORTS[1:])
    with pytest.raises(AssertionError, match="clk"):
        written(tmp_path, 2009, wrong)
