"""Libraries with faults: cores that FuseSoC cannot use, and dependencies that no core satisfies."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from fusesoc_firm.builds.setup.libraries import newest, open_libraries
from fusesoc_firm.cli import main
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.outputs import shown
from fusesoc_firm.tools.library_path import LINK, library_root

GOOD = """\
CAPI=2:
name: me:p:good:1.0
filesets: {tb: {files: [tb.vhd], file_type: vhdlSource}}
targets: {sim: {filesets: [tb], flow: sim, flow_options: {tool: ghdl}, toplevel: tb}}
"""
BENCH = """\
entity tb is
end entity tb;
architecture a of tb is
begin
  process begin report "hello"; wait; end process;
end architecture a;
"""
# The content of a core beside good ones, and a part of the report about it.
BROKEN = {
    "yaml": ("targets: {sim: [}", "while parsing a flow node"),
    "control character": ("description: \0", "control characters are not allowed"),
    "schema": ("targets: {sim: {fileset: [a]}}", "data.targets.sim must not contain {'fileset'}"),
    "version": ("name: me:p:bad:abc", "'abc' is not a version that FuseSoC can compare, such as 1.0.2"),
    "long version": (f"name: me:p:bad:{'9' * 5000}", "is not a version that FuseSoC can compare"),
    "virtual": ("virtual: [a b c]", "Illegal character in core name 'a b c'"),
    "virtual version": ("virtual: ['a:b:c:abc']", "'abc' is not a version that FuseSoC can compare"),
    "virtual of five parts": ("virtual: ['a:b:c:d:e']", "Illegal core name 'a:b:c:d:e'"),
    "endless alias": ("filesets: &a {b: *a}", "recursion"),
    "provider": ("provider: {name: nowhere}", "data.provider"),
}
Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library with one good core, as the current folder."""
    for name in ("HOME", "XDG_CONFIG_HOME", "FUSESOC_FIRM_CACHE"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.setenv("FUSESOC_CORES", "")
    root = tmp_path / "project"
    root.mkdir()
    monkeypatch.chdir(root)
    add("good", GOOD)
    Path("tb.vhd").write_text(BENCH)
    Path("fusesoc.conf").write_text("[library.p]\nlocation = .\n")
    Path("build").mkdir()
    Path("build/FUSESOC_IGNORE").touch()
    return root


def add(name: str, text: str) -> None:
    Path(f"{name}.core").write_text(text)


def targets(capsys: Captured, pattern: str = "*") -> list[str]:
    """The names of the cores with targets that match a pattern, without versions."""
    assert main(["query", "targets", pattern]) == 0
    return [line.split()[0].rpartition(":")[0] for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_core_is_named_and_does_not_stop_the_others(
    capsys: Captured, caplog: pytest.LogCaptureFixture, kind: str
) -> None:
    line, report = BROKEN[kind]
    name = "" if line.startswith("name:") else "name: me:p:bad:1.0\n"
    add("bad", f"CAPI=2:\n{name}{line}\n")
    assert targets(capsys) == ["me:p:good"]
    (warning,) = [record.getMessage() for record in caplog.records]
    assert str(Path("bad.core").absolute()) in warning
    assert report in warning
    # A core is found by solving, which includes all cores.
    assert main(["query", "generated", "me:p:good", "--target", "sim"]) == 0
    capsys.readouterr()
    assert main(["lock", "me:p:bad"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: unknown core 'me:p:bad'\n      = bad.core is ignored: ")
    assert main(["test", "me:p:bad"]) == 1
    assert "bad.core is ignored: " in capsys.readouterr().err


def test_a_virtual_name_under_a_flag_is_reported_when_the_flag_is_set(
    capsys: Captured, caplog: pytest.LogCaptureFixture
) -> None:
    add("bad", "CAPI=2:\nname: me:p:bad:1.0\nvirtual: ['target_sim ? (a:b:c:d:e)']\n")
    assert main(["query", "generated", "me:p:good", "--target", "sim"]) == 0
    assert [record.getMessage() for record in caplog.records] == [
        "bad.core: a name under 'virtual' is ignored: Illegal core name 'a:b:c:d:e'"
    ]


def depend(name: str, *depends: str) -> None:
    listed = ", ".join(f'"{item}"' for item in depends)
    bench = "files: [tb.vhd], file_type: vhdlSource, "
    add(
        name,
        f"CAPI=2:\nname: me:p:{name}:1.0\nfilesets:\n  tb: {{{bench}depend: [{listed}]}}\n"
        "targets: {sim: {filesets: [tb], flow: sim, flow_options: {tool: ghdl}, toplevel: tb},"
        " default: {filesets: [tb]}}\n",
    )


def faults(capsys: Captured, core: str) -> list[str]:
    """The reported lines without excerpts."""
    assert main(["query", "generated", core, "--target", "sim"]) == 1
    return [line for line in capsys.readouterr().err.splitlines() if not re.match(" *[0-9]* [|]", line)]


def test_a_missing_core_is_named_with_its_place_and_the_chain(capsys: Captured) -> None:
    depend("top", "me:p:good", "me:p:middle")
    depend("middle", "target_sim ? (other:lib:absent)", "me:p:good")
    assert faults(capsys, "me:p:top") == [
        "middle.core:4:57: error: unknown core 'other:lib:absent'",
        "      = needed by me:p:top:1.0 -> me:p:middle:1.0",
    ]


def test_several_missing_cores_are_reported_together(capsys: Captured) -> None:
    depend("top", "me:p:middle", "absent")
    depend("middle", "other:lib:absent")
    assert faults(capsys, "me:p:top") == [
        "top.core:4:72: error: unknown core 'absent'",
        "      = needed by me:p:top:1.0",
        "middle.core:4:57: error: unknown core 'other:lib:absent'",
        "      = needed by me:p:top:1.0 -> me:p:middle:1.0",
    ]


def test_a_version_that_no_core_has_is_a_fault(capsys: Captured) -> None:
    depend("top", ">=me:p:good:1.1")
    assert faults(capsys, "me:p:top") == [
        "top.core:4:57: error: no known version of core 'me:p:good' satisfies '>=me:p:good:1.1'",
        "      = needed by me:p:top:1.0; known versions: 1.0",
    ]


def test_a_missing_core_whose_file_is_broken(capsys: Captured) -> None:
    depend("top", "me:p:bad")
    add("bad", "CAPI=2:\nname: me:p:bad:1.0\ntargets: []\n")
    assert faults(capsys, "me:p:top")[1].startswith("      = needed by me:p:top:1.0; bad.core is ignored: ")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("filesets: [tb]", "filesets: [rtl]", "Fileset 'rtl', requested by target 'sim', was not found"),
        ("filesets: [tb]", "generate: [x]", "Generator instance 'x', requested by target 'sim', was not found"),
        ("me:p:good", "^me:p:good:1.x", "'^me:p:good:1.x' does not have a version that FuseSoC can compare"),
    ],
)
def test_a_fault_in_a_target_has_a_place(capsys: Captured, old: str, new: str, message: str) -> None:
    depend("top", "me:p:good")
    text = Path("top.core").read_text()
    assert old in text
    add("top", text.replace(old, new, 1))
    (fault,) = faults(capsys, "me:p:top")
    assert re.match(rf"(.*/)?top.core:\d:\d\d: error: {re.escape(message)}", fault), fault


def test_cores_that_cannot_be_used_together(capsys: Captured) -> None:
    for name in "ab":
        add(name, f"CAPI=2:\nname: me:p:{name}:1.0\nvirtual: [me:p:either]\n")
    depend("top", "me:p:a", "me:p:b")
    assert faults(capsys, "me:p:top") == [
        "error: me:p:a:1.0 and me:p:b:1.0 are needed together, but only one core can be 'me:p:either'"
    ]


def test_what_is_missing_is_shown_among_the_dependencies(capsys: Captured) -> None:
    depend("top", "me:p:middle")
    depend("middle", ">=other:lib:absent:2.0")
    assert main(["query", "deps", "me:p:top"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(maxsplit=1) for line in lines] == [
        [">=other:lib:absent:2.0", "missing"],
        ["me:p:middle:1.0", "lacks a core"],
        ["me:p:top:1.0", "lacks a core"],
    ]
    assert main(["query", "rdeps", ">=other:lib:absent:2.0"]) == 0
    assert "me:p:top:1.0" in capsys.readouterr().out


def test_an_older_version_counts_if_the_newest_lacks_a_core(capsys: Captured) -> None:
    """FuseSoC then uses it without a message."""
    for version, depends in (("1.0", ""), ("2.0", ""), ("3.0", "depend: [me:p:absent], ")):
        fileset = f"{{files: [tb.vhd], {depends}file_type: vhdlSource}}"
        targets = "targets: {default: {filesets: [a]}}"
        add(f"v{version}", f"CAPI=2:\nname: me:p:one:{version}\nfilesets: {{a: {fileset}}}\n{targets}\n")
    depend("middle", "me:p:one")
    depend("top", "me:p:middle")
    assert main(["query", "deps", "me:p:top"]) == 0
    assert [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()] == [
        ["me:p:absent", "missing"],
        ["me:p:middle:1.0"],
        ["me:p:one:2.0"],
        ["me:p:one:3.0", "lacks a core"],
        ["me:p:top:1.0"],
    ]
    # As FuseSoC resolves it.
    assert main(["query", "deps", "me:p:top", "--flag", "any"]) == 0
    assert capsys.readouterr().out.splitlines() == ["me:p:middle:1.0", "me:p:one:2.0", "me:p:top:1.0"]


def test_the_version_of_a_dependency_is_the_one_that_fusesoc_takes(capsys: Captured) -> None:
    for version in ("1.2", "1.10", "2.0"):
        add(f"v{version}", f"CAPI=2:\nname: me:p:one:{version}\ntargets: {{default: {{}}}}\n")
    depend("top", "^me:p:one:1.0")
    assert main(["query", "deps", "me:p:top"]) == 0
    assert capsys.readouterr().out.splitlines() == ["me:p:one:1.10", "me:p:top:1.0"]


@pytest.mark.parametrize(
    ("depend", "expected"),
    [
        ("me:p:one", "2.0"),
        ("me:p:one:1.2", "1.2"),
        ("<me:p:one:1.10", "1.2"),
        ("~me:p:one:1.2.0", "1.2"),
        ("^me:p:one:1.0", "1.10"),
        (">me:p:one:2.0", None),
    ],
)
def test_the_newest_version_that_satisfies_a_dependency(depend: str, expected: str | None) -> None:
    found = newest(depend, ["me:p:one:1.2", "me:p:one:1.10", "me:p:one:2.0"])
    assert found == (expected and f"me:p:one:{expected}")


@pytest.mark.skipif(not shutil.which("ghdl"), reason="GHDL is not installed")
def test_builds_without_the_missing_core_run(capsys: Captured) -> None:
    depend("top", "other:lib:absent")
    for command in (["test"], ["build", "me:p:top", "me:p:good", "--target", "sim"]):
        assert main(command) == 1
        lines = capsys.readouterr().out.splitlines()
        results = {line.split()[0]: line.split()[2] for line in lines if line.startswith("me:p:") and "build/" in line}
        good = results.pop("me:p:good:1.0", "")
        assert good in ("passed", "ok"), lines
        assert "    top.core:4:57: error: unknown core 'other:lib:absent'" in lines
    log = Path(shown(Path("build/me_p_top_1.0/sim.log")))
    assert "unknown core 'other:lib:absent'" in log.read_text()


LINKED = "[main]\nignored_dirs = build\n[library.firm]\nlocation = .firm/library\n[library.p]\nlocation = .\n"


@pytest.mark.parametrize("former", ["missing", "nowhere", "other"])
def test_the_link_to_our_library_is_renewed(former: str, tmp_path: Path) -> None:
    """A project with this link has no path of the machine on which it was written."""
    Path("fusesoc.conf").write_text(LINKED)
    (tmp_path / "other").mkdir()
    if former != "missing":
        LINK.parent.mkdir()
        LINK.symlink_to(tmp_path / former)
    found = {name: item["library"].name for name, item in open_libraries().cm.db._cores.items()}
    assert LINK.readlink() == library_root()
    assert {found[name] for name in found if name.startswith("robot:")} == {"firm"}
    assert {name for name in found if found[name] == "p"} == {"me:p:good:1.0"}
    assert [path.name for path in LINK.parent.iterdir() if path.name != LINK.name] == ["FUSESOC_IGNORE"]


def test_a_copy_of_the_library_is_kept() -> None:
    """`scp -r` copies what a link leads to."""
    Path("fusesoc.conf").write_text(LINKED)
    LINK.mkdir(parents=True)
    open_libraries()
    assert not LINK.is_symlink()


def test_a_library_that_cannot_be_linked_is_reported_with_its_place() -> None:
    Path("fusesoc.conf").write_text(LINKED)
    LINK.parent.touch()
    with pytest.raises(InputError, match=r"^fusesoc\.conf:\d+:\d+: error: library '\w+' is in \.firm/library, which"):
        open_libraries()
