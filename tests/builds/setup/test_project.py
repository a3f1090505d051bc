"""The dependencies of a project's cores, and the items they use: `firm graph`, `firm affected`, `firm lock`."""

from __future__ import annotations

import contextlib
import hashlib
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml

from fusesoc_firm import __version__
from fusesoc_firm.builds import project as project_module
from fusesoc_firm.builds.call.answer import main as generate
from fusesoc_firm.builds.setup.cores import project_cores
from fusesoc_firm.cli import main
from fusesoc_firm.tools.library_path import library_root
from fusesoc_firm.tools.own_code import PACKAGE
from fusesoc_firm.tools.programs import Program, debian_package

LEAF = """\
CAPI=2:
name: me:p:leaf:1.0
filesets: {rtl: {files: [leaf.vhd: {file_type: vhdlSource-93}, "target_sim ? (bench.vhd)"]}}
targets: {default: {filesets: [rtl]}}
"""
BRANCH = """\
CAPI=2:
name: me:p:branch:1.0
virtual: [me:p:tree]
filesets: {base: {depend: ["target_sim ? (me:p:leaf)"]}}
targets: {default: &default {filesets: [base]}, sim: {<<: *default}}
"""
TOP = """\
CAPI=2:
name: me:p:top:1.0
filesets: {base: {depend: ["me:p:tree", "robot:firm:generators"]}}
generate:
  size: {generator: firm, parameters: {message: my_msgs/Size, ros: 2, paths: [msg]}}
  foreign: {generator: another, parameters: {message: nothing}}
targets:
  default: {filesets: [base], generate: [size]}
  point: {filesets: [base], generate: [size: {message: geometry_msgs/Point}]}
"""
OTHER = """\
CAPI=2:
name: me:p:other:1.0
targets: {default: {}}
"""
FILES = {
    "leaf/leaf.core": LEAF,
    "leaf/leaf.vhd": "",
    "leaf/bench.vhd": "",
    "branch.core": BRANCH,
    "top/top.core": TOP,
    "top/msg/my_msgs/msg/Size.msg": "uint8 a\n",
    "top/msg/my_msgs/msg/Unused.msg": "uint8 a\n",
    "other/other.core": OTHER,
}
Captured = pytest.CaptureFixture[str]


def git(*arguments: str) -> None:
    subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments], check=True, capture_output=True)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository of four cores, as the current folder, next to our library."""
    for name in ("HOME", "XDG_CONFIG_HOME", "FUSESOC_FIRM_CACHE"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    root = tmp_path / "project"
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    libraries = {"p": ".", "firm": library_root() / "generators", "cores": library_root() / "cores"}
    conf = "".join(f"[library.{name}]\nlocation = {place}\n" for name, place in libraries.items())
    (root / "fusesoc.conf").write_text(conf)
    monkeypatch.chdir(root)
    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "all")
    return root


def touched(capsys: Captured, *arguments: str) -> dict[str, str]:
    """The affected cores of the project by name, with the reasons."""
    assert main(["affected", *arguments]) == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    return {name.split(":")[2]: reason for name, reason in lines}


def test_nothing_is_touched(project: Path, capsys: Captured) -> None:
    assert touched(capsys) == {}


@pytest.mark.parametrize("name", ["leaf/leaf.vhd", "leaf/bench.vhd", "leaf/leaf.core"])
def test_an_edit_touches_all_that_depend_on_it(project: Path, capsys: Captured, name: str) -> None:
    (project / name).write_text(f"{FILES[name]}# edited\n")
    found = {"branch": "by me:p:leaf:1.0", "leaf": name, "top": "by me:p:branch:1.0"}
    assert touched(capsys) == found
    git("commit", "-qam", "edit")
    assert touched(capsys) == {}
    assert touched(capsys, "--since", "HEAD~1") == found


def test_a_message_touches_what_is_made_of_it(project: Path, capsys: Captured) -> None:
    size = project / "top/msg/my_msgs/msg/Size.msg"
    size.with_name("Unused.msg").write_text("uint8 b\n")
    assert touched(capsys) == {}
    size.write_text("uint8 b\n")
    assert touched(capsys) == {"top": "top/msg/my_msgs/msg/Size.msg"}
    size.unlink()
    assert list(touched(capsys)) == ["top"]


def test_a_new_file_that_hides_another_one_counts(project: Path, capsys: Captured) -> None:
    point = project / "top/msg/geometry_msgs/msg/Point.msg"
    point.parent.mkdir(parents=True)
    point.write_text("uint8 a\n")
    assert touched(capsys) == {"top": "top/msg/geometry_msgs/msg/Point.msg"}


@pytest.mark.parametrize("name", ["templates/core/system.core.mustache", "text/naming.py"])
def test_our_own_files_touch_what_is_generated(
    project: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("fusesoc_firm.builds.project.changed_files", lambda *_: [PACKAGE / name])
    assert touched(capsys) == {"top": str(PACKAGE / name)}


def test_what_is_no_revision_or_no_repository_is_a_fault(project: Path, capsys: Captured) -> None:
    assert main(["affected", "--since", "nowhere"]) == 1
    assert capsys.readouterr().err.startswith("error: git rev-parse: ")
    shutil.rmtree(project / ".git")
    assert main(["affected"]) == 1
    assert "not a git repository" in capsys.readouterr().err


def test_files_of_all_targets_and_flags_are_found(project: Path) -> None:
    cores = {core.vlnv.split(":")[2]: core for core in project_cores()}
    assert [path.name for path in cores["leaf"].files] == ["leaf.core", "leaf.vhd", "bench.vhd"]
    assert cores["branch"].depends == {"me:p:leaf"}
    assert cores["branch"].names == {"me:p:branch", "me:p:tree"}
    assert [item.parameters.get("message") for item in cores["top"].calls] == [
        "my_msgs/Size",
        "nothing",
        "geometry_msgs/Point",
    ]
    assert "firm_generator.py" in {path.name for path in cores["generators"].files}


def test_conditions_and_appended_lists_are_read_as_fusesoc_does(project: Path) -> None:
    filesets = """\
filesets:
  base: &base
    files: ["!tool_ghdl ? (a.vhd target_sim ? (b.vhd c.vhd))", "d.vhd e.vhd": {file_type: vhdlSource-93}]
    depend: [">=me:p:leaf:0.9", "tool_ghdl ? (^me:p:branch:1.0)"]
  rest: {files_append: [f.vhd], depend_append: ["me:p:top:1.0"]}
"""
    (project / "other/other.core").write_text(OTHER.replace("targets:", f"{filesets}targets:"))
    (core,) = [core for core in project_cores() if core.vlnv == "me:p:other:1.0"]
    assert [path.stem for path in core.files] == ["other", *"abcdef"]
    assert core.depends == {"me:p:leaf", "me:p:branch", "me:p:top"}


def test_the_configuration_is_the_one_that_fusesoc_is_told(
    project: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    conf = (project / "fusesoc.conf").rename(project / "another.conf")
    assert main(["graph", "me:p:branch", "--format", "dot"]) == 1
    monkeypatch.setenv("FUSESOC_CONFIG", str(conf))
    assert main(["graph", "me:p:branch", "--format", "dot"]) == 0
    assert "me:p:branch" in capsys.readouterr().out


def test_a_place_in_a_graph_is_not_absolute(project: Path) -> None:
    """Files of the project, of our package and of neither."""
    own = Path(project_module.__file__).resolve()
    assert project_module._place(Path.cwd().resolve() / "a" / "b.vhd") == "a/b.vhd"
    assert project_module._place(own) == "fusesoc_firm/builds/project.py"
    assert project_module._place(Path.cwd().resolve().parent / "other" / "c.msg") == "../other/c.msg"


def test_graph(project: Path, capsys: Captured) -> None:
    assert main(["graph", "me:p:top", "--format", "dot"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert '  "me:p:top:1.0" -> "me:p:top-size:1.0"' in lines
    assert '  "me:p:top-size:1.0" -> "top/msg/my_msgs/msg/Size.msg"' in lines
    assert '  "me:p:top:1.0" -> "me:p:branch:1.0"' in lines
    assert '  "me:p:leaf:1.0" [shape=box]' not in lines
    assert main(["graph", "me:p:branch", "--target", "sim", "--format", "dot"]) == 0
    assert '  "me:p:branch:1.0" -> "me:p:leaf:1.0"' in capsys.readouterr().out.splitlines()


def test_files_of_one_name_are_two_and_any_name_can_be_drawn(project: Path, capsys: Captured) -> None:
    for name in ("one", 'the "other"'):
        message = project / name / "msg/my_msgs/msg/Size.msg"
        message.parent.mkdir(parents=True)
        message.write_text("uint8 a\n")
        core = TOP.replace("me:p:top", f"me:p:{name[:3]}").replace("me:p:tree", "me:p:one")
        (project / name / "x.core").write_text(core.replace('"me:p:one", ', "") if name == "one" else core)
    assert main(["graph", "me:p:the", "--format", "dot"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert '  "me:p:one-size:1.0" -> "one/msg/my_msgs/msg/Size.msg"' in lines
    assert '  "me:p:the-size:1.0" -> "the \\"other\\"/msg/my_msgs/msg/Size.msg"' in lines


@pytest.mark.skipif(not shutil.which("dot"), reason="Graphviz is not installed")
def test_graph_as_a_picture(project: Path) -> None:
    (project / "pictures").mkdir()
    assert main(["graph", "me:p:branch", "-o", "pictures/branch.svg"]) == 0
    assert "</svg>" in (project / "pictures/branch.svg").read_text()


def test_without_graphviz_it_says_so(project: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(project))
    assert main(["graph", "me:p:branch"]) == 1
    assert capsys.readouterr().err.startswith("error: pictures require Graphviz's program 'dot'")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["me:p:bush"], "unknown core 'me:p:bush'"),
        (["me:p:a bush"], "unknown core 'me:p:a bush'"),
        (["me:p:top", "--target", "fly"], "'me:p:top:1.0' has no target 'fly'"),
    ],
)
def test_what_is_unknown_is_a_fault(project: Path, capsys: Captured, arguments: list[str], message: str) -> None:
    assert main(["graph", *arguments]) == 1
    assert message in capsys.readouterr().err


def locked(capsys: Captured) -> list[str]:
    """The differences from the lock file of the top core."""
    status = main(["lock", "me:p:top", "--locked"])
    captured = capsys.readouterr()
    assert status == (1 if captured.err else 0)
    assert captured.err or captured.out == "top/top.lock: nothing differs\n"
    return [line.removeprefix("error: ") for line in captured.err.splitlines()]


def test_a_lock_names_messages_cores_and_tools(project: Path, capsys: Captured) -> None:
    assert main(["lock", "me:p:top"]) == 0
    assert capsys.readouterr().out == "top/top.lock\n"
    lock = yaml.safe_load((project / "top/top.lock").read_text())
    size = lock["messages"]["my_msgs/Size (ROS 2)"]
    assert size["source"] == "msg/my_msgs/msg/Size.msg"
    assert size["sha256"] == hashlib.sha256(b"uint8 a\n").hexdigest()
    assert size["signature"].startswith("RIHS01_")
    assert lock["messages"]["geometry_msgs/Point (ROS 2)"]["source"] == "rosbags ros2_jazzy"
    cores = {core["name"]: core.get("sha256") for core in lock["cores"]}
    assert {"me:p:branch:1.0", f"robot:axis:firm_axis:{__version__}"} <= cores.keys()
    # It is for a target that the core does not have.
    assert "me:p:leaf:1.0" not in cores
    # The core's own files are not locked.
    assert [name for name, digest in cores.items() if digest is None] == [
        "me:p:top:1.0",
        "me:p:top-size:1.0",
        "me:p:top-foreign:1.0",
    ]
    assert lock["tools"]["fusesoc"] == {"version": version("fusesoc")}
    assert locked(capsys) == []


def test_a_copy_of_the_project_is_locked_alike(
    project: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    main(["lock", "me:p:top"])
    capsys.readouterr()
    monkeypatch.chdir(project.rename(project.with_name("moved")))
    assert locked(capsys) == []


@pytest.mark.check
def test_what_differs_from_the_lock_is_said(project: Path, capsys: Captured) -> None:
    main(["lock", "me:p:top"])
    capsys.readouterr()
    # The core's own files are not locked.
    (project / "top/top.core").write_text(f"{TOP}# edited\n")
    assert locked(capsys) == []
    (project / "branch.core").write_text(f"{BRANCH}# edited\n")
    (found,) = locked(capsys)
    assert found.startswith("core me:p:branch:1.0: sha256 is ")
    (project / "branch.core").write_text(BRANCH)
    size = project / "top/msg/my_msgs/msg/Size.msg"
    size.write_text("uint8 a # its size\n")
    (found,) = locked(capsys)
    assert found.startswith("message my_msgs/Size (ROS 2): sha256 is ")
    size.write_text("uint8 b\n")
    assert [line.partition(" is ")[0] for line in locked(capsys)] == [
        "message my_msgs/Size (ROS 2): sha256",
        "message my_msgs/Size (ROS 2): signature",
    ]
    size.write_text("uint8 a\n")
    (project / "top/top.core").write_text(TOP.replace("me:p:tree", "me:p:other").replace("/Point", "/Vector3"))
    assert locked(capsys) == [
        "message geometry_msgs/Point (ROS 2) is locked, but not used",
        "message geometry_msgs/Vector3 (ROS 2) is used, but not locked",
        "core me:p:branch:1.0 is locked, but not used",
        "core me:p:other:1.0 is used, but not locked",
    ]


def test_tools_are_locked(project: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    def install(text: str) -> None:
        program = project / "bin" / "ghdl"
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!/bin/sh\necho {text}\n")
        program.chmod(0o755)

    monkeypatch.setattr("fusesoc_firm.tools.programs.PROGRAMS", {"ghdl": Program("ghdl")})
    monkeypatch.setenv("PATH", str(project / "bin"))
    install("GHDL 2.0.0")
    main(["lock", "me:p:top"])
    capsys.readouterr()
    install("GHDL 3.0.0")
    digest, version = locked(capsys)
    assert digest.startswith("tool ghdl: sha256 is ")
    assert version == "tool ghdl: version is GHDL 3.0.0, but the lock file has GHDL 2.0.0"
    # Another build of the same version, and another package.
    install("GHDL 2.0.0 # rebuilt")
    (digest,) = locked(capsys)
    assert digest.startswith("tool ghdl: sha256 is ")
    install("GHDL 2.0.0")
    assert locked(capsys) == []
    monkeypatch.setattr("fusesoc_firm.builds.call.lock_file.debian_package", lambda _: "ghdl 2.0.0-1")
    assert locked(capsys) == ["tool ghdl: package is ghdl 2.0.0-1, but the lock file has None"]
    (project / "bin" / "ghdl").unlink()
    assert locked(capsys) == ["tool ghdl is locked, but not installed"]
    # Additional installed programs do not count as a difference, either.
    main(["lock", "me:p:top"])
    capsys.readouterr()
    install("GHDL 2.0.0")
    assert locked(capsys) == []
    monkeypatch.setattr("fusesoc_firm.tools.own_code.digest", lambda: "edited")
    (found,) = locked(capsys)
    assert found.startswith("tool fusesoc-firm: sha256 is ")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "messages: {}\n",
        "messages: {}\ncores: {a: 1}\ntools: {}\n",
        "messages: {}\ncores: [{a: 1}]\ntools: {}\n",
        "{",
    ],
)
def test_what_is_no_lock_file_is_a_fault(project: Path, capsys: Captured, text: str) -> None:
    assert "cannot read" in locked(capsys)[0]
    (project / "top/top.lock").write_text(text)
    assert "is not a lock file" in locked(capsys)[0]


@pytest.mark.skipif(not shutil.which("dpkg-query"), reason="not a Debian system")
def test_the_package_of_a_program() -> None:
    shell = Path(str(shutil.which("sh")))
    assert debian_package(shell).split()[0] in ("dash", "bash")
    assert debian_package(Path("/nowhere/sh")) == ""


def test_fusesoc_reads_its_part_of_a_lock_file(project: Path) -> None:
    """The versions of the cores; and FuseSoC leaves the rest of the file alone."""
    flow = "  setup: {filesets: [base], generate: [size], toplevel: x, flow: generic, flow_options: {tool: ghdl}}\n"
    (project / "top/top.core").write_text(TOP.replace("me:p:tree", "me:p:other") + flow)
    main(["lock", "me:p:top"])
    lock = project / "top/top.lock"
    before = lock.read_text()
    assert "name: me:p:other:1.0\n" in before
    (project / "newest.core").write_text(OTHER.replace("me:p:other:1.0", "me:p:other:2.0"))
    fusesoc = "import sys; from fusesoc.main import main; sys.exit(main())"
    run = [sys.executable, "-c", fusesoc, "run", "--setup", "--target=setup", "--lockfile=top/top.lock", "me:p:top"]
    done = subprocess.run(run, cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (edam,) = (project / "build").rglob("*.eda.yml")
    assert [name for name in yaml.safe_load(edam.read_text())["cores"] if ":other:" in name] == ["me:p:other:1.0"]
    assert lock.read_text() == before


def test_what_a_dependency_has_generated_is_locked_too(project: Path, capsys: Captured) -> None:
    message = project / "maker/msg/my_msgs/msg/Size.msg"
    message.parent.mkdir(parents=True)
    message.write_text("uint32 a\n")
    (project / "maker/maker.core").write_text(TOP.replace("me:p:top", "me:p:maker").replace('"me:p:tree", ', ""))
    (project / "top/top.core").write_text(TOP.replace("me:p:tree", "me:p:maker"))
    main(["lock", "me:p:top"])
    capsys.readouterr()
    lock = yaml.safe_load((project / "top/top.lock").read_text())
    names = [name for name in lock["messages"] if name.startswith("my_msgs")]
    assert names == ["my_msgs/Size (ROS 2)", "my_msgs/Size (ROS 2) of me:p:maker-size:1.0"]
    assert {lock["messages"][name]["source"] for name in names} == {"msg/my_msgs/msg/Size.msg"}
    message.write_text("uint32 a # its size\n")
    assert [line.partition(" is ")[0] for line in locked(capsys)] == [
        "message my_msgs/Size (ROS 2) of me:p:maker-size:1.0: sha256",
        "core me:p:maker:1.0: sha256",
    ]


def call(project: Path, **more: object) -> int:
    """Call the generator as FuseSoC does for the top core."""
    work = project.parent / "work"
    work.mkdir(exist_ok=True)
    parameters = {"message": "my_msgs/Size", "ros": 2, "paths": ["msg"], **more}
    given = {"files_root": str(project / "top"), "vlnv": "me:p:top-size:1.0", "parameters": parameters}
    (work / "call.yml").write_text(yaml.safe_dump(given))
    with contextlib.chdir(work):
        return generate("firm", ["call.yml"])


@pytest.mark.parametrize("by", ["parameter", "environment"])
def test_a_generator_refuses_what_is_not_locked(
    project: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch, by: str
) -> None:
    main(["lock", "me:p:top"])
    lock = project / "top/top.lock"
    more = {"locked": "top.lock"} if by == "parameter" else {}
    if by == "environment":
        monkeypatch.setenv("FUSESOC_FIRM_LOCKED", str(lock))
    assert call(project, **more) == 0
    capsys.readouterr()
    size = project / "top/msg/my_msgs/msg/Size.msg"
    size.write_text("uint8 b\n")
    assert call(project, **more) == 1
    error = capsys.readouterr().err
    assert "error: message my_msgs/Size (ROS 2): sha256 is " in error
    assert "error: message my_msgs/Size (ROS 2): signature is RIHS01_" in error
    assert f"      = according to {lock}\n" in error
    assert call(project, **{**more, "message": "geometry_msgs/Vector3"}) == 1
    assert "message geometry_msgs/Vector3 (ROS 2) is used, but not locked" in capsys.readouterr().err
    size.write_text("uint8 a\n")
    # The core is in the store, and is compared nevertheless.
    assert call(project, **more) == 0
    monkeypatch.setattr("fusesoc_firm.tools.own_code.digest", lambda: "edited")
    assert call(project, **more) == 1
    assert "tool fusesoc-firm: sha256 is " in capsys.readouterr().err
    monkeypatch.undo()
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(project.parent / "home"))
    lock.unlink()
    if by == "parameter":
        assert call(project, **more) == 1
        assert f"cannot read {lock}" in capsys.readouterr().err


def test_a_lock_file_of_the_environment_is_absolute(
    project: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_LOCKED", "top.lock")
    assert call(project) == 1
    assert "write FUSESOC_FIRM_LOCKED=$PWD/top.lock" in capsys.readouterr().err


def test_with_and_without_a_lock_file_the_store_has_one_answer(project: Path, capsys: Captured) -> None:
    main(["lock", "me:p:top"])
    assert call(project) == call(project, locked="top.lock") == 0
    assert [line.split()[2] for line in capsys.readouterr().out.splitlines()[1:]] == ["generated", "from"]
