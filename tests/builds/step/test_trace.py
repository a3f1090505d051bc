"""What is observed of a step."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.places import Places, places_of
from fusesoc_firm.builds.step.trace import Trace, can_trace, parse, traced

needs_strace = pytest.mark.skipif(not can_trace(), reason="strace is not installed or not permitted")
# Two processes at work at the same time: 11 starts 12 in a folder below, whose calls come before the start has ended.
LINES = r"""
10 execve("/usr/bin/make", ["make", "/not/a/path"], 0x7ff /* 3 vars */) = 0
10 access("/etc/ld.so.preload", R_OK) = -1 ENOENT (No such file or directory)
10 openat(AT_FDCWD</work>, "Makefile", O_RDONLY) = 3</work/Makefile>
10 vfork( <unfinished ...>
11 chdir("sub")                     = 0
10 <... vfork resumed>)             = 11
11 clone3({flags=CLONE_VM}, 88 <unfinished ...>
12 openat(AT_FDCWD</work/sub>, "../src/a b\".v", O_RDONLY <unfinished ...>
11 <... clone3 resumed>)            = 12
12 <... openat resumed>)            = 4</work/src/a b">
12 unlink("old")                    = 0
12 rename("new", "/home/me/there")  = 0
12 mkdir("/nowhere/x", 0777)        = -1 ENOENT (No such file or directory)
12 openat(5</usr/share>, "names", O_RDONLY|O_DIRECTORY) = 6</usr/share/names>
12 openat(AT_FDCWD</work/sub>, "out", O_WRONLY|O_CREAT|O_TRUNC, 0666) = 6</work/sub/out>
12 creat("made", 0644)              = 7</work/sub/made>
12 openat(AT_FDCWD</work/sub>, "/usr/include/x.h", O_RDONLY) = -1 ENOENT (No such file or directory)
12 connect(7<socket:[1]>, {sa_family=AF_UNIX, sun_path="/run/nscd/socket"}, 110) = -1 ENOENT (No such file)
12 newfstatat(AT_FDCWD</work/sub>, "caf\303\251", {st_mode=S_IFREG|0644, ...}, 0) = 0
12 fchdir(5</usr/share>)            = 0
12 stat("words", {st_mode=S_IFREG}) = 0
12 +++ exited with 0 +++
"""


def test_a_record_is_read() -> None:
    trace = parse(iter(LINES.strip().splitlines()), "/work")
    assert trace.programs == {"/usr/bin/make"}
    assert trace.read == {"/work/Makefile", '/work/src/a b".v'}
    assert trace.written == {"/work/sub/old", "/work/sub/new", "/home/me/there", "/work/sub/out", "/work/sub/made"}
    assert trace.listed == {"/usr/share/names"}
    assert trace.asked == {"/etc/ld.so.preload", "/usr/include/x.h", "/work/sub/café", "/usr/share/words"}
    assert trace.network == set()


def test_the_network_is_observed() -> None:
    line = "9 connect(7<socket:[1]>, {sa_family=AF_INET, sin_port=htons(80)}, 16) = -1 EINPROGRESS (in progress)"
    assert parse(iter([line]), "/").network == {"connect"}


@needs_strace
def test_a_real_command_is_observed(tmp_path: Path) -> None:
    (tmp_path / "in here").write_text("x")
    code = "import os, subprocess; os.mkdir('d'); os.chdir('d'); subprocess.run(['cp', '../in here', 'out'])"
    with (tmp_path / "log").open("wb") as log:
        status, trace = traced([sys.executable, "-c", code], tmp_path, dict(os.environ), log)
    assert status == 0
    assert str(tmp_path / "in here") in trace.read
    assert {str(tmp_path / "d"), str(tmp_path / "d" / "out")} <= trace.written
    assert any(path.endswith("/cp") for path in trace.programs)
    assert not trace.network


@needs_strace
def test_a_real_connection_is_observed(tmp_path: Path) -> None:
    code = "import socket; s = socket.socket(); s.settimeout(0); s.connect_ex(('127.0.0.1', 9))"
    with (tmp_path / "log").open("wb") as log:
        assert traced([sys.executable, "-c", code], tmp_path, dict(os.environ), log)[1].network == {"connect"}


@pytest.fixture
def places() -> Places:
    environment = {"HOME": "/home/me", "PATH": "/home/me/bin:/home/me/suite/bin:/usr/bin", "CCACHE_DIR": "/ccache"}
    return places_of(Path("/work/build"), Path("/work/build.tmp"), environment, ["/work/given.txt"])


@pytest.mark.parametrize(
    "trace",
    [
        Trace(read={"/usr/include/stdio.h", "/home/me/suite/share/cells.v", "/home/me/bin/tool", "/work/given.txt"}),
        Trace(read={"/work/build/src/a.vhd", "/work/build.tmp/x", "/ccache/1", "/etc/passwd", "/proc/self/maps"}),
        Trace(written={"/work/build/out", "/work/build.tmp/x", "/ccache/1", "/dev/null", "/proc/self/comm"}),
        Trace(written={f"{sys.prefix}/lib/__pycache__/x.pyc"}, asked={"/home/me/secret"}, listed={"/work"}),
        Trace(read={"/home/me/.yosys_history"}, written={"/home/me/.yosys_history-71.tmp"}),
        Trace(
            read={"/home/me/.local/state/yosys/history"},
            written={"/home/me/.local", "/home/me/.local/state/yosys", "/home/me/.local/state/yosys/history"},
        ),
    ],
)
def test_what_a_step_may_do(places: Places, trace: Trace) -> None:
    assert places.fault(places.outside(trace)) == ""


@pytest.mark.parametrize(
    ("trace", "fault"),
    [
        (Trace(read={"/work/other.vhd"}), "it reads /work/other.vhd, which is not an input of its core"),
        (Trace(read={"/work/buildings"}), "it reads /work/buildings, which is not an input of its core"),
        (Trace(programs={"/home/me/x"}), "it reads /home/me/x, which is not an input of its core"),
        (Trace(written={"/home/me/.local/x"}), "it writes /home/me/.local/x, outside its folder"),
        (Trace(written={"/home/me/x", "/work/build/y"}), "it writes /home/me/x, outside its folder"),
        (Trace(written={"/dev/ttyUSB0"}), "it writes /dev/ttyUSB0, outside its folder"),
        (Trace(written={"/usr/share/x"}), "it writes /usr/share/x, outside its folder"),
        (Trace(network={"connect"}), "it uses the network"),
    ],
)
def test_what_a_step_may_not_do(places: Places, trace: Trace, fault: str) -> None:
    assert places.fault(places.outside(trace)) == fault


def test_the_interpreter_of_a_script_is_a_program(places: Places, tmp_path: Path) -> None:
    script = tmp_path / "tool"
    script.write_text("#! /usr/bin/perl -w\n")
    assert "/usr/bin/perl" in places.outside(Trace(programs={str(script)})).programs


def test_a_folder_above_is_not_recorded(places: Places) -> None:
    assert places.outside(Trace(listed={"/work", "/usr/share"})).listed == {"/usr/share"}
