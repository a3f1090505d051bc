"""Modules of both frameworks: their names and connections as the frameworks see them, compared with the netlists."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import pytest
from amaranth.back import rtlil
from amaranth.hdl import ClockDomain, DomainRenamer, Fragment, Instance, Module
from amaranth.lib import stream, wiring
from amaranth.sim import Simulator
from litex.build.sim import SimPlatform
from litex.gen import ClockDomain as LitexDomain
from litex.gen import LiteXModule
from litex.gen.fhdl.verilog import convert
from migen import Instance as LitexInstance
from migen.fhdl.bitcontainer import value_bits_sign
from migen.fhdl.structure import ClockSignal, ResetSignal, _Operator

from fusesoc_firm.cli import main
from fusesoc_firm.export.component.interfaces import infer
from fusesoc_firm.export.component.model import Component, Direction, Generic, Port, SourceFile
from fusesoc_firm.export.component.package import NETLIST, package
from fusesoc_firm.export.wrapper.framework import FRAMEWORKS
from fusesoc_firm.export.wrapper.wrapper import wrapper, write_wrapper
from fusesoc_firm.text.diagnostics import InputError
from tests.export.component.designs import alone, designed, netlist_ports, write_converter, write_verilog
from tests.export.wrapper.modules import load
from tests.hdl.ghdl import REPOSITORY

pytestmark = pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
Captured = pytest.CaptureFixture[str]
Ports = dict[str, tuple[str, int]]
IN, OUT, INOUT = Direction.IN, Direction.OUT, Direction.INOUT


@pytest.fixture(autouse=True)
def _place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone(tmp_path, monkeypatch)


def component(ports: Sequence[Port], generics: Sequence[Generic] = (), *files: SourceFile) -> Component:
    netlist = SourceFile(PurePosixPath("src/filter.v"), "verilogSource")
    return Component(
        "me", "robots", "filter", "1.0", "A 'filter' \\", "Verilog", ports, infer(ports), [netlist, *files], generics
    )


def module(item: Component, framework: str, folder: Path) -> Any:
    """The class of a component's wrapper."""
    path = folder / framework / "filter.py"
    (path.parent / "src").mkdir(parents=True)
    (path.parent / "src" / "filter.v").write_text("module filter; endmodule\n", encoding="ascii")
    path.write_text(wrapper(item, framework), encoding="utf-8")
    return load(path)


def litex_instance(made: LiteXModule) -> LitexInstance:
    (instance,) = (item for item in made.get_fragment().specials if isinstance(item, LitexInstance))
    return instance


def litex_ports(instance: LitexInstance) -> Ports:
    """The ports of an instance of LiteX, and the widths of what they are connected to."""
    sides = {LitexInstance.Input: "in", LitexInstance.Output: "out"}
    return {item.name: (sides[type(item)], _width(item.expr)) for item in instance.items if type(item) in sides}


def _width(value: Any) -> int:
    if isinstance(value, ClockSignal | ResetSignal):
        return 1
    if isinstance(value, _Operator) and value.op == "~":
        return _width(value.operands[0])
    return int(value_bits_sign(value)[0])


def amaranth_instance(made: Any) -> Instance:
    with pytest.warns(RuntimeWarning, match=r"amaranth\.sim simulates nothing of "):
        fragment = Fragment.get(made, None)
    ((instance, *_),) = fragment.subfragments
    assert isinstance(instance, Instance)
    return instance


def amaranth_ports(instance: Instance) -> Ports:
    """The ports of an instance of Amaranth, and the widths of what they are connected to."""
    return {name: ({"i": "in", "o": "out"}[kind], len(value)) for name, (value, kind) in instance.ports.items()}


def connected(made: Any, framework: str) -> Ports:
    """The ports of a wrapper's instance."""
    if framework == "litex":
        return litex_ports(litex_instance(made(SimPlatform("SIM", []))))
    return amaranth_ports(amaranth_instance(made()))


def check_connections(core: str, folder: Path) -> Iterator[tuple[str, Path]]:
    """The ports of the wrappers of a core are those that Yosys finds in its netlist; yield the modules."""
    made = package(designed(core), NETLIST)
    for framework in FRAMEWORKS:
        path, *files = write_wrapper(made, framework, Path(framework))
        assert connected(load(path), framework) == netlist_ports(made.component.name, files, folder)
        yield framework, path


@pytest.mark.parametrize("is_subscriber", [True, False])
def test_a_converter(tmp_path: Path, is_subscriber: bool) -> None:
    """Its fields are signals."""
    core = write_converter(tmp_path, "sensor_msgs/Range", is_subscriber=is_subscriber, width=32)
    for framework, path in check_connections(core, tmp_path):
        system = load(path)(*[SimPlatform("SIM", [])] * (framework == "litex"))
        assert len(system.min_range) == 32
        side = system.sink if is_subscriber else system.source
        assert len(side.data if framework == "litex" else side.payload.data) == 32
        # The text of the header is a stream of its own.
        assert hasattr(system.header_frame_id_axis, "valid")


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["obstacle", "multi_type", "joint_pid", "scan_sectors", "resize", "mobile_robot"])
def test_systems(tmp_path: Path, name: str) -> None:
    assert len([*check_connections(str(REPOSITORY / "specs" / name / f"{name}.yaml"), tmp_path)]) == len(FRAMEWORKS)


NAMES = [Port("clk", IN), *(Port(name, IN, (3, 0)) for name in ("lambda", "comb", "elaborate", "sink", "Class"))]


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_names_that_python_or_the_framework_has(tmp_path: Path, framework: str) -> None:
    ports = [*NAMES, Port("s_axis_tdata", IN, (7, 0)), Port("s_axis_tvalid", IN)]
    made = module(component(ports), framework, tmp_path)
    assert connected(made, framework) == {port.name: ("in", port.width) for port in ports}
    system = made(*[SimPlatform("SIM", [])] * (framework == "litex"))
    # The stream has the name first.
    assert len(system.lambda_) == len(system.sink_) == len(system.Class) == 4
    assert len(system.comb_ if framework == "litex" else system.elaborate_) == 4


@pytest.mark.parametrize("framework", FRAMEWORKS)
@pytest.mark.parametrize("unit", ["mux", "path", "instance"])
def test_units_with_names_of_the_framework(tmp_path: Path, unit: str, framework: str) -> None:
    ports = [Port("s_axis_tdata", IN, (7, 0)), Port("s_axis_tkeep", IN, (0, 0)), Port("s_axis_tvalid", IN)]
    text = wrapper(replace(component(ports), name=unit), framework)
    names: dict[str, Any] = {"__file__": str(tmp_path / f"{unit}.py"), "__name__": unit}
    exec(compile(text, unit, "exec", dont_inherit=True), names)
    assert connected(names[f"{unit.capitalize()}_"], framework).keys() == {port.name for port in ports}


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_no_attribute_of_the_framework_is_a_port(framework: str) -> None:
    classes = {"litex": LiteXModule(), "amaranth": wiring.Component}
    assert {name for name in dir(classes[framework]) if not name.startswith("_")} <= FRAMEWORKS[framework].reserved


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_streams_without_some_ports(tmp_path: Path, framework: str) -> None:
    """A source without keep sends whole beats, and a sink without ready is always ready."""
    ports = [Port("s_axis_tdata", IN, (31, 0)), Port("s_axis_tvalid", IN)]
    ports += [Port("m_axis_tdata", OUT, (31, 0)), Port("m_axis_tvalid", OUT), Port("m_axis_tready", IN)]
    made = module(component(ports), framework, tmp_path)
    assert connected(made, framework).keys() == {port.name for port in ports}
    if framework == "litex":
        platform = SimPlatform("SIM", [])
        system = made(platform)
        text = str(convert(system, {*system.source.flatten(), *system.sink.flatten()}))
        assert "assign sink_ready = 1'd1;" in text
        assert "assign source_payload_keep = 4'd15;" in text
    else:
        system = made()
        assert system.sink.signature.always_ready
        assert not system.source.signature.always_ready


def test_the_default_values_of_inputs_and_parameters(tmp_path: Path) -> None:
    ports = [Port("level", IN, (3, 0), 5), Port("is_on", IN, None, 1), Port("q", OUT)]
    generics = [Generic("WIDTH", "integer", 24, False), Generic("NAME", "string", 'a"b', False)]
    item = component(ports, generics)
    made = module(item, "litex", tmp_path)(SimPlatform("SIM", []))
    assert (made.level.reset.value, made.is_on.reset.value) == (5, 1)
    parameters = {part.name: part.value for part in litex_instance(made).items if type(part) is LitexInstance.Parameter}
    assert parameters["NAME"] == 'a"b'
    assert parameters["WIDTH"].value == 24
    other = module(item, "amaranth", tmp_path)()
    assert (other.level.init, other.is_on.init) == (5, 1)
    assert amaranth_instance(other).parameters == {"WIDTH": 24, "NAME": 'a"b'}


CLOCKS = [*(Port(name, IN) for name in ("clk", "rst_n", "clk_slow", "slow_reset", "clk_sync")), Port("q", OUT)]


def test_clock_domains_of_litex(tmp_path: Path) -> None:
    made = module(component(CLOCKS), "litex", tmp_path)

    class Top(LiteXModule):  # type: ignore[misc]
        def __init__(self) -> None:
            self.cd_fast, self.cd_other = LitexDomain("fast"), LitexDomain("other")
            self.inner = made(SimPlatform("SIM", []), clock_domain="fast", slow_domain="other", sync_domain="fast")

    top = Top()
    text = str(convert(top, {top.cd_fast.clk, top.cd_fast.rst, top.cd_other.clk, top.cd_other.rst}))
    pairs = {"clk": "fast_clk", "rst_n": "(~fast_rst)", "clk_slow": "other_clk"}
    for port, signal in pairs.items():
        assert f".{port}({signal})" in "".join(text.split())


def test_clock_domains_of_amaranth(tmp_path: Path) -> None:
    made = module(component(CLOCKS), "amaranth", tmp_path)
    m = Module()
    # A clock does not get the domain of the first one.
    domains = [ClockDomain("sync"), ClockDomain("other"), ClockDomain("sync_")]
    m.domains += domains
    m.submodules.inner = DomainRenamer({"slow": "other"})(made())
    with pytest.warns(RuntimeWarning, match="filter"):
        text = rtlil.convert(m, ports=[signal for domain in domains for signal in (domain.clk, domain.rst)])
    for port, signal in {"clk": "clk", "clk_slow": "other_clk", "clk_sync": "sync__clk"}.items():
        assert f"connect \\{port} \\{signal} [0]\n" in text


def test_amaranth_knows_the_files(tmp_path: Path) -> None:
    """A platform gets the files, without a warning; nothing that a user's source does not drive is without bytes."""
    included = SourceFile(PurePosixPath("src/sizes.vh"), "verilogSource", is_include_file=True)
    ports = [Port("s_axis_tdata", IN, (31, 0)), Port("s_axis_tkeep", IN, (3, 0)), Port("s_axis_tvalid", IN)]
    made = module(component(ports, (), included), "amaranth", tmp_path)
    (tmp_path / "amaranth" / "src" / "sizes.vh").touch()
    added = {}

    class Platform:
        def add_file(self, name: str, content: str) -> None:
            added[name] = content

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Fragment.get(made(), Platform())
    assert added == {"src/filter.v": "module filter; endmodule\n", "src/sizes.vh": ""}
    assert [path.is_file() for path in made.files] == [True, True]
    beat = made().sink.payload
    assert beat.as_value().init >> 32 == 0b1111
    source = stream.Signature(beat.shape()).create()
    wiring.connect(Module(), source, made().sink)


def test_the_simulator_of_amaranth_simulates_nothing(tmp_path: Path) -> None:
    """The wrapper warns of that, as the simulator has no message."""
    made = module(component([Port("a", IN), Port("q", OUT)]), "amaranth", tmp_path)()
    with pytest.warns(RuntimeWarning, match=r"amaranth\.sim simulates nothing of filter, whose outputs stay 0"):
        simulator = Simulator(made)
    simulator.run()


def test_a_core_in_verilog(tmp_path: Path, capsys: Captured) -> None:
    """The files of its target are those of the module, with the folder of what they include; pins stay outside."""
    core = Path(write_verilog(tmp_path))
    core.write_text(core.read_text(encoding="utf-8").replace(", rom.mem: {file_type: user}", ""), encoding="utf-8")
    source = "src/me_robots_filter_2.1.4"
    assert main(["wrap", "--framework", "litex", str(core), "-o", "wrapped"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "module:     wrapped/filter.py",
        "interfaces: s_axis, aresetn, aclk; 5 ports",
        f"files:      wrapped/{source}/filter.v, wrapped/{source}/sizes.vh",
    ]
    platform = SimPlatform("SIM", [])
    ports = litex_ports(litex_instance(load(Path("wrapped/filter.py"))(platform)))
    assert ports["s_axis_tdata"] == ("in", 24)
    assert [source[0] for source in platform.sources] == [str(tmp_path / "wrapped" / source / "filter.v")]
    assert platform.verilog_include_paths == [str(tmp_path / "wrapped" / source)]


def test_faults(tmp_path: Path, capsys: Captured) -> None:
    assert main(["wrap", "--framework", "litex", write_verilog(tmp_path), "-o", "wrapped"]) == 1
    assert "rom.mem is not in Verilog" in capsys.readouterr().err
    assert not [*(tmp_path / "wrapped").iterdir()]
    with pytest.raises(SystemExit, match="2"):
        main(["wrap", "--framework", "litx", "filter.core", "-o", "wrapped"])
    assert "did you mean 'litex'?" in capsys.readouterr().err
    with pytest.raises(InputError, match="port 'pin' of 'filter' is bidirectional"):
        wrapper(component([Port("pin", INOUT)]), "amaranth")
