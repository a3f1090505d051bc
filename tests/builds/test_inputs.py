"""One list of inputs: what lets `firm test` run again is also affected and locked."""

from __future__ import annotations

import contextlib
import random
import re
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.trace import can_trace
from fusesoc_firm.cli import main
from fusesoc_firm.tools.library_path import library_root
from fusesoc_firm.tools.programs import find

Captured = pytest.CaptureFixture[str]

# A test bench that prints a constant and the first line of a file.
BENCH = """\
use std.textio.all;
entity tb is
  generic (name : string := "{file}");
end entity tb;
architecture a of tb is
begin
  process
    file data : text;
    variable content : line;
  begin
    file_open(data, name, read_mode);
    readline(data, content);
    report "{core}: " & content.all & " " & work.{package}.value;
    wait;
  end process;
end architecture a;
"""
PACKAGE = 'package {name} is\n  constant value : string := "{value}";\nend package {name};\n'
TARGETS = "targets: {{default: &all {{filesets: [all]{more}}}, sim: {{<<: *all, toplevel: tb, {tool}}}}}\n"
FLOW, TOOL = "flow: sim, flow_options: {tool: ghdl}", "default_tool: ghdl"
GENERATOR = """\
import sys

import yaml

import shape

call = yaml.safe_load(open(sys.argv[1]))
table = open(f"{call['files_root']}/{call['parameters']['table']}").read().strip()
open("made.vhd", "w").write(shape.TEXT % table)
open("made.core", "w").write(
    f"CAPI=2:\\nname: {call['vlnv']}\\n"
    "filesets: {a: {files: [made.vhd], file_type: vhdlSource}}\\ntargets: {default: {filesets: [a]}}\\n"
)
"""
SHAPE = 'TEXT = """package made is\n  constant value : string := "%s";\nend package made;\n"""\n'


def core(name: str, files: str, more: str = "", tool: str = "", sections: str = "") -> str:
    targets = TARGETS.format(more=more, tool=tool or TOOL)
    return f"CAPI=2:\nname: me:p:{name}\nfilesets: {{all: {{{files}}}}}\n{sections}{targets}"


def library(name: str, version: str = "1.0", more: str = "") -> str:
    """A core without tests, with a package in `<name>.vhd`."""
    return (
        f"CAPI=2:\nname: me:p:{name}:{version}\n{more}"
        f"filesets: {{all: {{files: [{name}.vhd], file_type: vhdlSource}}}}\n"
        "targets: {default: {filesets: [all]}}\n"
    )


def files_of(root: Path) -> dict[str, str]:
    """A project with inputs of all kinds; each core with a bench has a test."""
    data = "data/text.txt"

    def bench(name: str, package: str, file: str = data) -> str:
        return BENCH.format(core=name, package=package, file=file)

    copied = "data: {copyto: data, file_type: user}"
    return {
        "fusesoc.conf": "".join(
            f"[library.{name}]\nlocation = {place}\n"
            for name, place in {"p": ".", "firm": library_root() / "generators", "c": library_root() / "cores"}.items()
        ),
        "README.md": "nothing reads this\n",
        "leaf.core": library("leaf"),
        "leaf.vhd": PACKAGE.format(name="leaf", value="leaf"),
        # A folder that is copied to the work folder.
        "folder/folder.core": core(
            "folder:1.0", f'files: [{copied}, tb.vhd], file_type: vhdlSource, depend: ["me:p:leaf"]'
        ),
        "folder/data/text.txt": "folder",
        "folder/data/inner/unread.txt": "folder",
        "folder/tb.vhd": bench("folder", "leaf"),
        # The core of another one has the folder.
        "above/above.core": core(
            "above:1.0", 'files: [tb.vhd], file_type: vhdlSource, depend: ["me:p:store"]', tool=FLOW
        ),
        "above/tb.vhd": bench("above", "store"),
        "store/store.core": library("store").replace("[store.vhd]", f"[{copied}, store.vhd]"),
        "store/data/text.txt": "store",
        "store/store.vhd": PACKAGE.format(name="store", value="store"),
        # The default of a parameter.
        "firmware/firmware.core": core(
            "firmware:1.0",
            'files: [tb.vhd], file_type: vhdlSource, depend: ["me:p:leaf"]',
            ", parameters: [name]",
            sections="parameters: {name: {datatype: file, paramtype: generic, "
            f"default: {root}/firmware/sw/prog.hex}}}}\n",
        ),
        "firmware/sw/prog.hex": "firmware",
        "firmware/tb.vhd": bench("firmware", "leaf"),
        # A generator of somebody else, whose folder set-ups share.
        "lib/gen.core": "CAPI=2:\nname: me:g:gen:1.0\ngenerators:\n  mk: {interpreter: python3, command: mk.py,"
        " cache_type: input, file_input_parameters: table}\ntargets: {default: {}}\n",
        "lib/mk.py": GENERATOR,
        "lib/shape.py": SHAPE,
        "table/table.core": core(
            "table:1.0",
            f'files: [{copied}, tb.vhd], file_type: vhdlSource, depend: ["me:g:gen"]',
            ", generate: [t]",
            sections="generate: {t: {generator: mk, position: prepend, parameters: {table: table.txt}}}\n",
        ),
        "table/table.txt": "table",
        "table/data/text.txt": "table",
        "table/tb.vhd": bench("table", "made"),
        "over/over.core": core("over:1.0", 'depend: ["me:p:table"]', tool=FLOW),
        # A generator of ours.
        "made/made.core": core(
            "made:1.0",
            f'files: [{copied}, tb.vhd], file_type: vhdlSource, depend: ["robot:firm:generators", "me:p:leaf"]',
            ", generate: [m]",
            sections="generate: {m: {generator: firm, parameters: {message: my_msgs/Size, ros: 2, paths: [msg]}}}\n",
        ),
        "made/msg/my_msgs/msg/Size.msg": "uint8 a\n",
        "made/data/text.txt": "made",
        "made/tb.vhd": bench("made", "leaf"),
        # A virtual core, and a core that a mapping replaces.
        "one.core": library("one", more="virtual: [me:p:either]\n"),
        "one.vhd": PACKAGE.format(name="one", value="one")
        .replace("one is", "either is")
        .replace("package one", "package either"),
        "virtual/virtual.core": core(
            "virtual:1.0", f'files: [{copied}, tb.vhd], file_type: vhdlSource, depend: ["me:p:either", "me:p:one"]'
        ),
        "virtual/data/text.txt": "virtual",
        "virtual/tb.vhd": bench("virtual", "either"),
        "mapped/mapped.core": core(
            "mapped:1.0", f'files: [{copied}, tb.vhd], file_type: vhdlSource, depend: ["me:p:old"]'
        ),
        "mapped/data/text.txt": "mapped",
        "mapped/tb.vhd": bench("mapped", "old"),
        "map.core": "CAPI=2:\nname: me:p:map:1.0\nmapping: {'me:p:old': 'me:p:new'}\n",
        "old.core": library("old"),
        "old.vhd": PACKAGE.format(name="old", value="old"),
        "new.core": library("new"),
        "new.vhd": PACKAGE.format(name="old", value="new"),
        "build/FUSESOC_IGNORE": "",
        ".gitignore": "build/*\n!build/FUSESOC_IGNORE\n*.lock\n",
    }


def git(*arguments: str) -> None:
    subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments], check=True, capture_output=True)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The project, as the current folder."""
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME", "FUSESOC_FIRM_CACHE"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.setenv("FUSESOC_CORES", "")
    monkeypatch.setenv("FUSESOC_FIRM_ACTIONS_TWICE", "0")
    root = tmp_path / "project"
    for name, text in files_of(root).items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.chdir(root)
    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "all")
    return root


def affected(capsys: Captured) -> dict[str, str]:
    """The affected cores by name, with the reasons."""
    capsys.readouterr()
    assert main(["affected"]) == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    return {name.split(":")[2]: reason for name, reason in lines}


def is_locked(capsys: Captured, name: str, *options: str) -> bool:
    """Whether a core's inputs are those of its lock file."""
    capsys.readouterr()
    is_equal = main(["lock", f"me:p:{name}", "--locked", *options]) == 0
    error = capsys.readouterr().err
    assert is_equal == (not error)
    assert all("is locked" in line or "lock file has" in line or "not locked" in line for line in error.splitlines())
    return is_equal


def lock(*names: str, options: tuple[str, ...] = ()) -> None:
    for name in names:
        assert main(["lock", f"me:p:{name}", *options]) == 0


# A file of the project, the core whose part it is, and a core that depends on this core.
PARTS = [
    ("store/data/text.txt", "store", "above"),
    ("store/data/new.txt", "store", "above"),
    ("table/table.txt", "table", "over"),
    ("lib/mk.py", "gen", "over"),
    ("lib/shape.py", "gen", "over"),
    ("one.vhd", "one", "virtual"),
    ("leaf.core", "leaf", "made"),
]


@pytest.mark.parametrize(("file", "owner", "dependent"), PARTS)
def test_a_part_is_affected_and_locked(project: Path, capsys: Captured, file: str, owner: str, dependent: str) -> None:
    lock(dependent)
    assert affected(capsys) == {}
    with (project / file).open("a") as part:
        part.write("\n# edited\n")
    found = affected(capsys)
    assert found[owner] == file
    assert found[dependent].startswith("by me:")
    assert not is_locked(capsys, dependent)
    git("checkout", "-q", ".")
    git("clean", "-fq")
    assert is_locked(capsys, dependent)


def test_a_removed_part_is_affected_and_locked(project: Path, capsys: Captured) -> None:
    lock("above")
    (project / "store/data/text.txt").unlink()
    assert affected(capsys) == {"above": "by me:p:store:1.0", "store": "store/data/text.txt"}
    assert not is_locked(capsys, "above")


def test_the_default_of_a_parameter_of_the_type_file(project: Path, capsys: Captured) -> None:
    """Also one that is relative to the core, and one of a target."""
    core_file = project / "firmware/firmware.core"
    for old, new in ((f"{project}/firmware/", ""), ("parameters: [name]", 'parameters: ["name=sw/prog.hex"]')):
        (project / "firmware/sw/prog.hex").write_text("edited")
        assert affected(capsys) == {"firmware": "firmware/sw/prog.hex"}
        git("checkout", "-q", ".")
        core_file.write_text(core_file.read_text().replace(old, new))
        git("commit", "-qam", "edit")
    (project / "firmware/sw/prog.hex").write_text("edited")
    assert affected(capsys) == {"firmware": "firmware/sw/prog.hex"}


def test_a_core_that_is_gone_or_has_another_name(project: Path, capsys: Captured) -> None:
    (project / "leaf.core").write_text(library("tree"))
    found = affected(capsys)
    assert found["made"] == found["folder"] == "leaf.core"
    (project / "leaf.core").unlink()
    assert affected(capsys)["made"] == "leaf.core"


def test_the_list_of_libraries_affects_all(project: Path, capsys: Captured) -> None:
    conf = project / "fusesoc.conf"
    conf.write_text(f"{conf.read_text()}# edited\n")
    assert set(affected(capsys).values()) == {"fusesoc.conf"}
    git("checkout", "-q", ".")
    (project / "lib/FUSESOC_IGNORE").touch()
    assert set(affected(capsys).values()) == {"lib/FUSESOC_IGNORE"}


def test_mappings_apply_to_locks_and_queries(project: Path, capsys: Captured) -> None:
    mapping = ("--mapping", "me:p:map:1.0")
    for options, used, other in ((mapping, "new", "old"), ((), "old", "new")):
        lock("mapped", options=options)
        for name in (used, other):
            (project / f"{name}.vhd").write_text("-- edited\n")
            assert is_locked(capsys, "mapped", *options) == (name == other)
            assert affected(capsys)["mapped"] == f"by me:p:{name}:1.0"
            git("checkout", "-q", ".")
        assert main(["query", "deps", "me:p:mapped", *options]) == 0
        assert capsys.readouterr().out.splitlines() == ["me:p:mapped:1.0", f"me:p:{used}:1.0"]
    assert main(["lock", "me:p:mapped", "--mapping", "me:p:leaf:1.0"]) == 1
    assert "doesn't contain a mapping" in capsys.readouterr().err


def test_flags_apply_to_locks_and_queries(project: Path, capsys: Captured) -> None:
    text = (project / "mapped/mapped.core").read_text()
    (project / "mapped/mapped.core").write_text(
        text.replace('"me:p:old"', '"modern ? (me:p:new)", "!modern ? (me:p:old)"')
    )
    for options, used in (((), "old"), (("--flag", "modern"), "new"), (("--flag=-modern",), "old")):
        lock("mapped", options=options)
        assert f"me:p:{used}:1.0" in (project / "mapped/mapped.lock").read_text()
        if options:
            capsys.readouterr()
            assert main(["query", "deps", "me:p:mapped", *options]) == 0
            assert capsys.readouterr().out.splitlines() == ["me:p:mapped:1.0", f"me:p:{used}:1.0"]


def test_fetched_sources_are_locked(project: Path, capsys: Captured) -> None:
    """`firm lock` fetches them as a build does."""
    origin = project.parent / "origin"
    origin.mkdir()
    with contextlib.chdir(origin):
        git("init", "-q", "-b", "main")
        Path("leaf.vhd").write_text(PACKAGE.format(name="leaf", value="fetched"))
        git("add", ".")
        git("commit", "-qm", "all")
    remote = library("leaf", more=f"provider: {{name: git, repo: '{origin}', patches: [leaf.patch]}}\n")
    (project / "leaf.core").write_text(remote)
    (project / "leaf.vhd").unlink()
    git("commit", "-qam", "remote")
    lock("made")
    assert is_locked(capsys, "made")
    (fetched,) = (project.parent / "home").rglob("leaf.vhd")
    (fetched.parent / ".git/description").write_text("another clone\n")
    assert is_locked(capsys, "made")
    fetched.write_text(PACKAGE.format(name="leaf", value="edited"))
    assert not is_locked(capsys, "made")
    (project / "leaf.patch").write_text("new\n")
    assert affected(capsys)["leaf"] == "leaf.patch"


@dataclass
class Edits:
    """Random edits of a project, one at a time; `undo` restores the last commit."""

    project: Path
    chance: random.Random
    number: int = 0
    kinds: list[Callable[[], str]] = field(init=False)

    def __post_init__(self) -> None:
        self.kinds = [self.word, self.word, self.word, self.comment, self.unread, self.version]

    def files(self, pattern: str) -> list[Path]:
        listed = subprocess.run(["git", "ls-files"], capture_output=True, text=True, check=True).stdout.splitlines()
        return [self.project / name for name in listed if re.search(pattern, name)]

    def apply(self) -> str:
        """Edit a file; return a description."""
        self.number += 1
        return self.chance.choice(self.kinds)()

    def word(self) -> str:
        """Change what a test prints, or the name of a field of a message."""
        path = self.chance.choice(
            self.files(r"(text\.txt|table\.txt|prog\.hex|leaf\.vhd|one\.vhd|old\.vhd|store\.vhd|msg)$")
        )
        text, new = path.read_text(), f"w{self.number}"
        if path.suffix == ".vhd":
            text = re.sub('"[^"]*"', f'"{new}"', text)
        else:
            text = f"uint8 {new}\n" if path.suffix == ".msg" else new
        path.write_text(text)
        return f"content of {path.name}"

    def comment(self) -> str:
        """Add a comment to a core, a script or a VHDL file."""
        path = self.chance.choice(self.files(r"\.(core|py|vhd)$"))
        path.write_text(f"{path.read_text()}{'--' if path.suffix == '.vhd' else '#'} {self.number}\n")
        return f"comment in {path.name}"

    def unread(self) -> str:
        """Add a file, which may be in a folder that is copied."""
        folder = self.chance.choice([self.project, self.project / "store/data", self.project / "folder/data/inner"])
        (folder / f"f{self.number}.txt").write_text("new")
        return f"file in {folder.name}"

    def version(self) -> str:
        """Add a newer version of a core, or remove it."""
        path = self.project / "newer.core"
        if path.exists():
            path.unlink()
            return "an older version"
        path.write_text(library("leaf", "2.0").replace("leaf.vhd", "newer.vhd"))
        (self.project / "newer.vhd").write_text(PACKAGE.format(name="leaf", value=f"v{self.number}"))
        return "a newer version"


# The edits of the usual tests.
_FEW = 3
TESTS = ("above", "firmware", "folder", "made", "mapped", "over", "table", "virtual")


def run_tests(capsys: Captured, *options: str) -> dict[str, str]:
    """The result of each test, by the name of its core."""
    capsys.readouterr()
    status = main(["test", *options])
    text = capsys.readouterr().out
    assert status == 0, text
    rows = [line.split() for line in text.splitlines() if line.startswith("me:p:") and "build" in line]
    return {row[0].split(":")[2]: row[2] for row in rows}


def printed(root: Path) -> dict[str, list[str]]:
    """What each test printed."""
    logs = {path.parent.name: path.read_text() for path in root.glob("*/sim*.log")}
    return {name: re.findall(r"report note\): (.*)", text) for name, text in logs.items()}


@pytest.mark.skipif(not can_trace(), reason="strace is not installed or not permitted")
@pytest.mark.skipif(find("ghdl") is None, reason="GHDL is not installed")
@pytest.mark.parametrize(
    "count", [pytest.param(_FEW, marks=pytest.mark.check), pytest.param(200, marks=pytest.mark.thorough)]
)
def test_random_edits(project: Path, capsys: Captured, count: int) -> None:
    # The usual tests always make the same edits; more of them are new ones.
    seed = 1 if count == _FEW else random.randrange(2**32)
    with capsys.disabled():
        print(f"seed {seed}")
    edits = Edits(project, random.Random(seed))
    assert run_tests(capsys) == dict.fromkeys(TESTS, "passed")
    ran = 0
    for _ in range(count):
        lock(*TESTS)
        what = f"seed {seed}, edit {edits.number + 1}: {edits.apply()}"
        git("add", ".")
        found = affected(capsys)
        # Which of two versions of a core a build takes is known to the lock, and not to `affected`.
        is_exact = not (project / "newer.core").exists()
        for name in TESTS:
            reason = found.get(name, "")
            # The files of the core itself are not locked.
            if not reason or reason.startswith("by "):
                has_changed = not is_locked(capsys, name)
                assert has_changed <= bool(reason) <= (has_changed or not is_exact), f"{what}: {name} {reason}"
        results = run_tests(capsys)
        again = {name for name, result in results.items() if result != "cached"}
        ran += len(again)
        assert again <= found.keys(), what
        git("commit", "-qm", what)
    before = printed(project / "build")
    assert set(run_tests(capsys, "--rerun", "--build-root", "build/again").values()) == {"passed"}
    assert printed(project / "build/again") == before
    with capsys.disabled():
        print(f"{count} edits: {ran} tests ran")


@pytest.mark.check
@pytest.mark.skipif(find("ghdl") is None, reason="GHDL is not installed")
def test_set_ups_share_the_folder_of_a_foreign_generator(project: Path, capsys: Captured) -> None:
    """Both targets call the generator, whose folder is empty, or was left by a set-up that was killed."""
    slow = "import time\n\ntime.sleep(0.5)\n"
    (project / "lib/mk.py").write_text(f"{slow}{GENERATOR}")
    builds = ["build", "me:p:over", "me:p:table", "--target", "sim", "--setup"]
    assert main(builds) == 0, capsys.readouterr().out
    (folder,) = (path for path in (project.parent / "home").rglob("generator_cache/*") if path.is_dir())
    (made,) = folder.rglob("made.core")
    made.unlink()
    folder.with_name(f"{folder.name}.lock").write_text("being written")
    assert main(builds) == 0, capsys.readouterr().out
    assert made.is_file()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("copyto: data", "copyto: ../../data", "'../../data' leads out of the build folder"),
        ("copyto: data", "copyto: /tmp/data", "'/tmp/data' leads out of the build folder"),
        ("copyto: data", "copyto: sub/../../../data", "'sub/../../../data' leads out of the build folder"),
    ],
)
def test_a_copy_out_of_the_build_folder_is_refused(
    project: Path, capsys: Captured, old: str, new: str, message: str
) -> None:
    path = project / "folder/folder.core"
    path.write_text(path.read_text().replace(old, new))
    assert main(["build", "me:p:folder", "--target", "sim", "--setup"]) == 1
    assert f"    folder/folder.core:3:41: error: {message}" in capsys.readouterr().out
    assert not (project / "build/me_p_folder_1.0/sim-ghdl").exists()
