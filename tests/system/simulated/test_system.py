"""Generated systems in simulation with the real host: every byte against a model, with stalls and without."""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.runs.simulation import simulation_core
from fusesoc_firm.system.system_core import load_requested
from fusesoc_firm.text.diagnostics import InputError
from tests.hdl.frames import traffic
from tests.hdl.ghdl import CORES, REPOSITORY, GhdlError, Library, core_files
from tests.seeds import seeded
from tests.system.simulated.systems import DATA, GeneratedSystem, build, call

SEED = seeded(20240601)
# The frame of geometry_msgs/Vector3 and Point in ROS 1: id, length, three float64.
VECTOR_BEATS = 5 + 24

Message = dict[str, Any]


def write_stimuli(path: Path, messages: list[tuple[str, Message]]) -> Path:
    path.write_text(yaml.safe_dump([{block: message} for block, message in messages]), encoding="utf-8")
    return path


def numbers(source: random.Random, *names: str) -> Message:
    return {name: source.choice([source.uniform(-1e3, 1e3), source.gauss(0, 1), 0.0]) for name in names}


def vectors(block: str, count: int) -> list[tuple[str, Message]]:
    source = random.Random(SEED)
    return [(block, numbers(source, "x", "y", "z")) for _ in range(count)]


def many(count: int) -> Iterator[tuple[str, Message]]:
    """Points and vectors in turn, since an accelerator waits for both; poses in between."""
    source = random.Random(SEED)
    for number in range(count):
        pair = [("point_sub", numbers(source, "x", "y", "z")), ("vector_sub", numbers(source, "x", "y", "z"))]
        yield from pair if number % 3 else reversed(pair)
        if source.random() < 0.5:
            pose = {"position": numbers(source, "x", "y", "z"), "orientation": numbers(source, "x", "y", "z", "w")}
            yield "pose_sub", pose


def in_version(spec: Path, version: str, folder: Path) -> Path:
    """A copy of a specification for another version of ROS, beside copies of its accelerators."""
    folder.mkdir()
    for source in DATA.glob("*.vhd"):
        (folder / source.name).write_bytes(source.read_bytes())
    copied = folder / spec.name
    copied.write_text(spec.read_text(encoding="utf-8").replace("ROS1", version), encoding="utf-8")
    return copied


# --- several converters and accelerators ---------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["ROS1", "ROS2"])
def many_system(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> GeneratedSystem:
    folder = tmp_path_factory.mktemp("many")
    spec = in_version(DATA / "many.yaml", request.param, folder / "spec")
    stimuli = write_stimuli(folder / "stimuli.yaml", list(many(25)))
    return build(call(spec, stimuli, DATA / "many_model.py"), folder / "work")


@pytest.mark.one_in(3, 3)
@pytest.mark.parametrize(("seed", "stall_percent"), [(1, 0), (2, 25), (3, 60), (4, 90)])
def test_chains_forks_and_joins(many_system: GeneratedSystem, seed: int, stall_percent: int) -> None:
    assert many_system.passes(SEED=seed, STALL_PERCENT=stall_percent)


def test_many_blocks_make_no_latch(many_system: GeneratedSystem) -> None:
    assert many_system.work.latches(many_system.entity) == []


def test_names_that_mean_something_else(tmp_path: Path) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli.yaml", vectors("manager", 10))
    system = build(call(DATA / "names.yaml", stimuli, DATA / "names_model.py"), tmp_path / "work")
    assert system.passes(SEED=3)
    # A bridge, too: each frame comes as ROS 1 and goes as ROS 2.
    assert system.work.latches(system.entity) == []


# --- parts of messages ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["ROS1", "ROS2"])
def parts_system(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> GeneratedSystem:
    folder = tmp_path_factory.mktemp("parts")
    spec = in_version(DATA / "parts.yaml", request.param, folder / "spec")
    stimuli = write_stimuli(folder / "stimuli.yaml", list(poses(24)))
    return build(call(spec, stimuli, DATA / "parts_model.py"), folder / "work")


def poses(count: int) -> Iterator[tuple[str, Message]]:
    source = random.Random(SEED)
    for number in range(count):
        # `second` waits for both of the others.
        for block in ("part_sub", "other_sub", "pose_sub")[:: 1 if number % 2 else -1]:
            yield block, {"position": numbers(source, "x", "y", "z"), "orientation": numbers(source, *"xyzw")}


@pytest.mark.one_in(3, 3)
@pytest.mark.parametrize(("seed", "stall_percent"), [(1, 0), (2, 25), (3, 60), (4, 90)])
def test_messages_of_which_blocks_use_parts(parts_system: GeneratedSystem, seed: int, stall_percent: int) -> None:
    assert parts_system.passes(SEED=seed, STALL_PERCENT=stall_percent)


def test_parts_cost_what_is_used(parts_system: GeneratedSystem) -> None:
    """What nobody takes or drives has no port."""
    converters = {path.stem: path.read_text("utf-8") for path in parts_system.files if "geometry_msgs" in path.stem}
    ports = {
        name: re.findall(r"^    ((?:position|orientation)_\w)", text, re.MULTILINE) for name, text in converters.items()
    }
    position, orientation = [f"position_{axis}" for axis in "xyz"], [f"orientation_{axis}" for axis in "xyzw"]
    assert ports == {
        "geometry_msgs_pose_pkg": [],
        "axis_to_geometry_msgs_pose": position + orientation,
        "axis_to_geometry_msgs_pose_part_sub": ["position_x", *orientation],
        "axis_to_geometry_msgs_pose_other_sub": position,
        "geometry_msgs_pose_to_axis": position + orientation,
        "geometry_msgs_pose_to_axis_turn_pub": orientation,
        "geometry_msgs_pose_to_axis_w_pub": ["orientation_w"],
        "geometry_msgs_pose_to_axis_place_pub": position,
        "geometry_msgs_pose_to_axis_swapped_pub": ["position_x", "position_y"],
    }
    assert parts_system.work.latches(parts_system.entity) == []


# --- throughput ----------------------------------------------------------------------------------------------------


def test_full_throughput(tmp_path: Path) -> None:
    """An accelerator that keeps a message lets frames follow each other without a gap, in and out."""
    spec = simple_specification(tmp_path, "rotate")
    count = 40
    stimuli = write_stimuli(tmp_path / "stimuli.yaml", vectors("sub", count))
    system = build(call(spec, stimuli, rotate_model(tmp_path)), tmp_path / "work")
    result = system.run(STALL_PERCENT=0)
    assert result.exit_code == 0
    figures = traffic(result.output)
    assert (figures.beats_in, figures.beats_out) == (count * VECTOR_BEATS, count * VECTOR_BEATS)
    # One frame is received before the first is sent; a few cycles are registers on the way.
    assert figures.cycles <= (count + 1) * VECTOR_BEATS + 8


# --- what fails ----------------------------------------------------------------------------------------------------


def simple_specification(folder: Path, accelerator: str) -> Path:
    """A Vector3 through one of the accelerators here, in ROS 1."""
    (folder / f"{accelerator}.vhd").write_bytes((DATA / f"{accelerator}.vhd").read_bytes())
    vector = {"middleware": "ROS", "message": "geometry_msgs/Vector3"}
    specification = {
        "project": {"name": "simple"},
        "accelerators": [
            {
                "name": accelerator,
                "type": "VHDL",
                "sources": f"{accelerator}.vhd",
                "interface": {"input": [vector], "output": [vector]},
            }
        ],
        "blocks": [
            {"name": "sub", "mode": "subscriber", **vector, "outgoing": [{"name": "acc"}]},
            {"name": "acc", "type": accelerator, "outgoing": [{"name": "pub"}]},
            {"name": "pub", "mode": "publisher", **vector},
        ],
    }
    path = folder / "simple.yaml"
    path.write_text(yaml.safe_dump(specification, sort_keys=False), encoding="utf-8")
    return path


def rotate_model(folder: Path, fields: str = '{"x": m["z"], "y": m["x"], "z": m["y"]}') -> Path:
    path = folder / "model.py"
    path.write_text(f'def respond(_, m):\n    return [("pub", {fields})]\n', encoding="utf-8")
    return path


@pytest.fixture
def simple(tmp_path: Path) -> GeneratedSystem:
    stimuli = write_stimuli(tmp_path / "stimuli.yaml", vectors("sub", 5))
    return build(call(simple_specification(tmp_path, "rotate"), stimuli, rotate_model(tmp_path)), tmp_path / "work")


def test_a_wrong_model_fails(tmp_path: Path) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli.yaml", vectors("sub", 5))
    model = rotate_model(tmp_path, '{"x": m["z"], "y": m["x"], "z": m["y"] + 1}')
    result = build(call(simple_specification(tmp_path, "rotate"), stimuli, model), tmp_path / "work").run()
    assert result.exit_code != 0
    assert "FAIL 0/5" in result.output.splitlines()
    # The last eight bytes are z; its exponent differs for sure.
    assert re.search(r"'pub geometry_msgs/Vector3 .*': byte 2\d: expected", result.output)


def test_a_hanging_accelerator_ends_by_the_watchdog(tmp_path: Path) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli.yaml", vectors("sub", 8))
    system = build(call(simple_specification(tmp_path, "hang"), stimuli, rotate_model(tmp_path)), tmp_path / "work")
    result = system.run(WATCHDOG=500)
    assert result.exit_code != 0
    assert any(line.startswith("FAIL 0/8") for line in result.output.splitlines())
    assert "missing: 'pub" in result.output


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("00 18 00", "00 17 00", "frame_error(0) pulses"),
        ("00 18 00", "07 18 00", "id_error pulses"),
    ],
)
def test_a_broken_frame_fails_the_run(simple: GeneratedSystem, old: str, new: str, message: str) -> None:
    path = simple.folder / "stimulus.txt"
    text = path.read_text(encoding="ascii")
    # The last frame, so that the answers to the others are still the ones that are expected.
    before, found, after = text.rpartition(old)
    assert found
    path.write_text(f"{before}{new}{after}", encoding="ascii")
    result = simple.run(WATCHDOG=500)
    assert result.exit_code != 0
    assert message in result.output
    assert "FAIL 4/5" in result.output


def test_broken_frames_that_are_announced_pass(simple: GeneratedSystem) -> None:
    path = simple.folder / "stimulus.txt"
    path.write_text(path.read_text(encoding="ascii") + "> broken\n  00 18000000 01\n> astray\n  09 00\n", "ascii")
    path = simple.folder / "expected.txt"
    path.write_text("! frame_error 1\n! id_error 1\n" + path.read_text(encoding="ascii"), "ascii")
    assert simple.passes()


# --- C++ -----------------------------------------------------------------------------------------------------------


def typed_stimuli() -> Iterator[tuple[str, Message]]:
    signed = {"i": 8, "value": 16, "remaining": 32, "result": 64}
    unsigned = {"words": 8, "index": 16, "status": 32, "first": 64}
    source = random.Random(SEED)
    for number in range(15):
        message: Message = {"done": number % 2 == 0}
        for name, bits in signed.items():
            message[name] = [-(2 ** (bits - 1)), 2 ** (bits - 1) - 1, 0, -1, 5][number % 5]
        for name, bits in unsigned.items():
            message[name] = [0, 2**bits - 1, 1, 2 ** (bits - 1)][number % 4]
        message["start"] = [0.5, float("inf"), -1.25, -0.0][number % 4]
        message["run"] = [1e-3, float("-inf"), 1e300][number % 3]
        yield "sub", message
        pair = ["minuend", "subtrahend"]
        source.shuffle(pair)
        for block in pair:
            yield block, {"data": source.choice([2**31 - 1, -(2**31), 0, 7, -7])}


@pytest.fixture(scope="module")
def typed(tmp_path_factory: pytest.TempPathFactory) -> GeneratedSystem:
    folder = tmp_path_factory.mktemp("typed")
    stimuli = write_stimuli(folder / "stimuli.yaml", list(typed_stimuli()))
    spec = DATA / "typed.yaml"
    return build(call(spec, stimuli, DATA / "typed_model.py", paths=["typed_msgs"]), folder / "work")


@pytest.mark.parametrize(("seed", "stall_percent"), [(5, 0), (6, 30), (7, 80)])
def test_functions_of_every_type(typed: GeneratedSystem, seed: int, stall_percent: int) -> None:
    assert typed.passes(SEED=seed, STALL_PERCENT=stall_percent)


def test_no_path_gets_into_a_compiled_function(typed: GeneratedSystem, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere"
    shutil.copytree(DATA, copy)
    stimuli = write_stimuli(tmp_path / "stimuli.yaml", list(typed_stimuli()))
    request = call(copy / "typed.yaml", stimuli, copy / "typed_model.py", paths=["typed_msgs"])
    files = simulation_core.simulation_core(request, load_requested(request)).files
    for name in ("libnegate.so", "libcopy.so", "libdifference.so"):
        assert files[name].content == (typed.folder / name).read_bytes()


def kernel_fault(folder: Path, code: str) -> str:
    """What is said about the C++ of a system that takes and gives an Int32."""
    (folder / "twice.cpp").write_text(code, encoding="utf-8")
    (folder / "unlisted.h").write_text("int helper(int);\n", encoding="utf-8")
    spec = folder / "twice.yaml"
    spec.write_text(_TWICE, encoding="utf-8")
    (folder / "model.py").write_text("def respond(_, message):\n    return [('pub', message)]\n", encoding="utf-8")
    stimuli = write_stimuli(folder / "stimuli.yaml", [("sub", {"data": 0})])
    request = call(spec, stimuli, folder / "model.py")
    loaded = load_requested(request)
    with pytest.raises(InputError) as raised:
        simulation_core.simulation_core(request, loaded)
    with pytest.raises(InputError, match=re.escape(str(raised.value).partition("\n")[0])):
        simulation_core.check(request, loaded, may_run=False)
    return str(raised.value)


_TWICE = """\
project: {name: twice}
accelerators:
  - name: doubled
    type: HLS
    sources: twice.cpp
    interface:
      input: [{middleware: ROS, message: std_msgs/Int32}]
      output: [{middleware: ROS, message: std_msgs/Int32}]
blocks:
  - {name: sub, middleware: ROS, mode: subscriber, message: std_msgs/Int32, outgoing: [{name: acc}]}
  - {name: acc, type: doubled, outgoing: [{name: pub}]}
  - {name: pub, middleware: ROS, mode: publisher, message: std_msgs/Int32}
"""
_PROTOTYPE = "      = expected: void twice(std::int32_t data_in, std::int32_t *data_out)"


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("void thrice(int data_in, int *data_out) {}\n", "'twice' was not declared in this scope"),
        ("void twice(int data_in) {}\n", "too many arguments"),
        ("#include <cstdint>\nvoid twice(std::int32_t data_in, std::int32_t *data_out);\n", "undefined reference"),
    ],
)
def test_a_fault_in_cpp_is_shown_with_the_prototype(tmp_path: Path, code: str, message: str) -> None:
    text = kernel_fault(tmp_path, code)
    assert text.startswith(f"{tmp_path / 'twice.yaml'}:5:14: error: the C++ of 'doubled' does not compile:")
    assert message in text
    assert text.endswith(_PROTOTYPE)


@pytest.mark.parametrize(
    ("body", "column", "hint"),
    [
        ("    *data_out = 2 * data_inn;", 21, "declare it, correct its name, or include its header"),
        ('#include "gain.h"', 10, "put the header beside the source"),
        ("    data_out = data_in;", 16, "an output is a pointer: write '*name = value;'"),
        ("    *data_out = data_in", 24, "is a ';', a ')' or a '}' missing before this place?"),
        (
            "    *data_out = std::sqrt(data_in);",
            22,
            "declare it, correct its name, or include its header, such as <cmath>",
        ),
    ],
)
def test_a_fault_in_cpp_has_its_own_place_and_cure(tmp_path: Path, body: str, column: int, hint: str) -> None:
    text = kernel_fault(tmp_path, f"void twice(int data_in, int *data_out) {{\n{body}\n}}\n")
    assert text.startswith(f"{tmp_path / 'twice.cpp'}:2:{column}: error: ")
    assert f"      = {hint}" in text
    assert text.count("error: ") == 1


def test_a_brace_that_is_not_closed_has_its_place(tmp_path: Path) -> None:
    """The compiler's error is in the generated file that includes the source."""
    text = kernel_fault(tmp_path, "void twice(int data_in, int *data_out) {\n    *data_out = 2 * data_in;\n")
    assert text.startswith(f"{tmp_path / 'twice.cpp'}:1:40: error: nothing closes this '{{'\n")
    assert text.endswith("= its counterpart is missing: each '{' needs a '}'")


def test_an_included_file_must_be_a_source(tmp_path: Path) -> None:
    text = kernel_fault(tmp_path, '#include "unlisted.h"\nvoid twice(int data_in, int *data_out) {}\n')
    assert f"'doubled' includes files that are not sources: {tmp_path / 'unlisted.h'}" in text


# --- the main job and all VHDL -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def quat2euler(tmp_path_factory: pytest.TempPathFactory) -> GeneratedSystem:
    folder = tmp_path_factory.mktemp("quat2euler")
    spec = REPOSITORY / "specs" / "quat2euler"
    request = call(spec / "quat2euler.yaml", spec / "stimuli.yaml", spec / "model.py")
    return build(request, folder, "acc/cordic/cordic", "acc/float64/float64")


def test_quat2euler_makes_no_latch(quat2euler: GeneratedSystem) -> None:
    assert quat2euler.work.latches(quat2euler.entity) == []


@pytest.mark.check
def test_the_netlist_of_quat2euler_does_the_same(quat2euler: GeneratedSystem) -> None:
    assert quat2euler.passes(SEED=8, STALL_PERCENT=40)
    quat2euler.replace_by_netlist()
    assert "firm_manager" in (quat2euler.folder / "quat2euler_system_netlist.vhd").read_text(encoding="utf-8")
    assert quat2euler.passes(SEED=8, STALL_PERCENT=40)


def test_every_vhdl_file_of_the_house_is_vhdl_93(tmp_path: Path) -> None:
    """In the order of what cores depend on; `build` does the same with all that is generated."""
    library = Library("firm", tmp_path)
    analysed: set[Path] = set()
    for fileset in ("rtl", "tb"):
        for core, filesets in cores_in_order():
            named = core_files(core, fileset=fileset) if fileset in filesets else []
            if files := [path for path in named if path.suffix == ".vhd"]:
                library.analyse(files)
                analysed |= set(files)
    # Benches that are in no .core file, accelerators, and those of these tests, in folders' order: rtl before tb.
    others = {path for folder in (CORES, REPOSITORY / "specs", DATA) for path in folder.rglob("*.vhd")} - analysed
    assert REPOSITORY / "specs" / "quat2euler" / "rtl" / "quat2euler.vhd" in others
    in_order = [*dict.fromkeys(application_files())]
    assert others.issuperset(in_order)
    Library("work", tmp_path).analyse([*in_order, *sorted(others.difference(in_order))])


def cores_in_order() -> Iterator[tuple[str, dict[str, dict[str, list[str]]]]]:
    """Each core's path below cores/ and its filesets, behind those that its RTL depends on."""
    paths = {}
    filesets = {}
    for path in sorted(CORES.rglob("*.core")):
        core = yaml.safe_load(path.read_text(encoding="utf-8"))
        name = core["name"].rpartition(":")[0]
        paths[name], filesets[name] = path.relative_to(CORES).with_suffix("").as_posix(), core["filesets"]
    # Also those that it depends on for some targets only.
    graph = {name: re.findall(r"robot:\w+:\w+", str(found["rtl"].get("depend"))) for name, found in filesets.items()}
    for name in TopologicalSorter(graph).static_order():
        yield paths[name], filesets[name]


def application_files() -> Iterator[Path]:
    """The VHDL that the applications' cores name: accelerators in the order of the specifications, environments."""
    for core in sorted((REPOSITORY / "specs").rglob("*.core")):
        calls = yaml.safe_load(core.read_text(encoding="utf-8"))["generate"].values()
        for parameters in (item["parameters"] for item in calls):
            specification = yaml.safe_load((core.parent / parameters["spec"]).read_text(encoding="utf-8"))
            for accelerator in specification["accelerators"]:
                sources = accelerator["sources"]
                names = [sources] if isinstance(sources, str) else sources
                yield from (core.parent / name for name in names if name.endswith(".vhd"))
            yield from (core.parent / name for name in parameters.get("environment", []))


def test_a_fault_in_generated_vhdl_is_found(tmp_path: Path) -> None:
    spec = simple_specification(tmp_path, "rotate")
    source = tmp_path / "rotate.vhd"
    source.write_text(source.read_text(encoding="utf-8").replace("in_y    ", "in_v    ", 1), encoding="utf-8")
    stimuli = write_stimuli(tmp_path / "stimuli.yaml", vectors("sub", 1))
    with pytest.raises(GhdlError, match="rotate"):
        build(call(spec, stimuli, rotate_model(tmp_path)), tmp_path / "work")
