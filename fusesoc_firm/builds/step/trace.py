"""Observe with `strace` the files that a step reads and writes, the programs it starts, and its use of the network.

`strace` follows every process of the step and stops it only for the traced calls. Unlike a preloaded library, it also
sees programs that are linked statically and system calls without the C library, and needs no compiler. It does not see:

* reads by the kernel: the dynamic linker and a script's interpreter; the interpreter in a script's first line is added
* a path of which a program reads only the link's target: a compiler does this for each part of each header's path
* files that were open before the step started, and shared memory
* work that a server does for the step on a local socket
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import IO

_CALLS = (
    "open,openat,openat2,creat,execve,execveat,chdir,fchdir,clone,clone3,fork,vfork,connect,bind,sendto,sendmsg,"
    "unlink,unlinkat,rmdir,rename,renameat,renameat2,mkdir,mkdirat,link,linkat,symlink,symlinkat,truncate,chmod,"
    "fchmodat,utime,utimes,futimesat,utimensat,mknod,mknodat,stat,lstat,newfstatat,statx,access,faccessat,faccessat2"
)
# From <sys/personality.h>.
_ADDR_NO_RANDOMIZE = 0x0040000
_OPEN = frozenset("open openat openat2".split())
_EXEC = frozenset("execve execveat".split())
_FORK = frozenset("clone clone3 fork vfork".split())
_NETWORK = frozenset("connect bind sendto sendmsg".split())
_ASK = frozenset("stat lstat newfstatat statx access faccessat faccessat2".split())
_TO_WRITE = re.compile(r"O_(?:WRONLY|RDWR|CREAT|TRUNC)")

_CALL = re.compile(r"(\w+)\((.*)\) += (-?\d+|\?)(?:<((?:[^>\\]|\\.)*)>)?(?: (E\w+))?")
# The most frequent call, a lookup of an absolute path; the rest of the line is not needed.
_QUESTION = re.compile(r'(?:newfstatat|stat|lstat|access)\((?:(?:AT_FDCWD|\d+)<[^>\\]*>, )?"(/[^"\\]*)".* = ')
_UNFINISHED = re.compile(r"(.*?) <unfinished \.\.\.>$")
_RESUMED = re.compile(r"<\.\.\. (\w+) resumed>(.*)")
# A path, with the folder to which it is relative if the call names one.
_PATH = re.compile(r'(?:(?:AT_FDCWD|\d+)<((?:[^>\\]|\\.)*)>, )?"((?:[^"\\]|\\.)*)"')
_FOLDER = re.compile(r"\d+<((?:[^>\\]|\\.)*)>")
_END = "+++ "
_ESCAPE = re.compile(r"\\([0-7]{1,3}|.)")
_LETTERS = {"n": "\n", "t": "\t", "r": "\r", "v": "\v", "f": "\f", "a": "\a", "b": "\b"}


@dataclass
class Trace:
    """Absolute paths by their use; `asked` are paths whose existence or status was looked up, also missing ones."""

    programs: set[str] = field(default_factory=set)
    read: set[str] = field(default_factory=set)
    listed: set[str] = field(default_factory=set)
    asked: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    network: set[str] = field(default_factory=set)


@cache
def can_trace() -> bool:
    """Return whether `strace` is installed and permitted here."""
    if shutil.which("strace") is None:
        return False
    command = ["strace", "-f", "-qq", "--seccomp-bpf", "-e", "trace=execve", "-o", os.devnull, "true"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def traced(
    command: Sequence[str],
    folder: Path,
    environment: Mapping[str, str],
    output: IO[bytes],
    within: Callable[[Path], Sequence[str]] = lambda _: (),
) -> tuple[int, Trace]:
    """Run a command in a folder, with its output in a file; return the exit status and the trace.

    `within` returns the beginning of a command line that starts `strace`, which must be able to write to this folder.
    """
    with tempfile.TemporaryDirectory(prefix="firm-trace-") as place:
        record = Path(place, "trace")
        options = ["-f", "-y", "-q", "--seccomp-bpf", "-e", f"trace={_CALLS}", "-e", "signal=none", "-o", str(record)]
        status = subprocess.run(
            [*within(Path(place)), "strace", *options, "--", *command],
            cwd=folder,
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            check=False,
        ).returncode
        with record.open(encoding="utf-8", errors="surrogateescape") as lines:
            return status, parse(lines, str(folder))


@cache
def fix_addresses() -> None:
    """Start later processes with the same addresses each time, where the system permits that.

    Some tools, such as Icarus Verilog, write addresses into their outputs.
    """
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).personality(_ADDR_NO_RANDOMIZE)


def parse(lines: Iterator[str], folder: str) -> Trace:
    """Return the trace in the output of `strace -f -y` for a command that was started in `folder`."""
    return _Parser(folder).run(lines)


@dataclass
class _Parser:
    start: str
    trace: Trace = field(default_factory=Trace)
    # The current folder of each process, and the beginnings of calls that other processes interrupted.
    folders: dict[str, str] = field(default_factory=dict)
    begun: dict[str, str] = field(default_factory=dict)

    def run(self, lines: Iterator[str]) -> Trace:
        questions: set[str] = set()
        for line in lines:
            process, _, text = line.rstrip("\n").partition(" ")
            text = text.strip()
            if process not in self.folders:
                self.folders[process] = self._parents_folder()
            if match := _QUESTION.match(text):
                questions.add(match[1])
            elif text.startswith(_END):
                # Another process may reuse the number.
                del self.folders[process]
            elif match := _UNFINISHED.match(text):
                self.begun[process] = match[1]
            else:
                if match := _RESUMED.match(text):
                    text = self.begun.pop(process, f"{match[1]}(") + match[2]
                if match := _CALL.match(text):
                    self._add(process, match)
        self.trace.asked.update(map(os.path.normpath, questions))
        return self.trace

    def _parents_folder(self) -> str:
        """Return the current folder of the process that is creating another one; its call may not have ended yet."""
        makers = [process for process, text in self.begun.items() if text.partition("(")[0] in _FORK]
        return self.folders[makers[-1]] if makers else self.start

    def _add(self, process: str, found: re.Match[str]) -> None:
        call, arguments, value, error = found[1], found[2], found[3], found[5]
        is_done = not error and value != "?"
        if call in _FORK:
            if is_done:
                # The new process may already have changed its folder.
                self.folders.setdefault(value, self.folders[process])
        elif call in _NETWORK:
            if "sa_family=AF_INET" in arguments:
                self.trace.network.add(call)
        elif call == "fchdir":
            if is_done and (match := _FOLDER.match(arguments)):
                self.folders[process] = _text(match[1])
        else:
            self._add_paths(process, call, arguments, is_done=is_done)

    def _add_paths(self, process: str, call: str, arguments: str, *, is_done: bool) -> None:
        paths = [
            os.path.normpath(os.path.join(_text(above) if above else self.folders[process], _text(path)))
            for above, path in _PATH.findall(arguments)
            if path
        ]
        if not paths:
            return
        trace = self.trace
        if call == "chdir":
            if is_done:
                self.folders[process] = paths[0]
        elif call in _EXEC:
            (trace.programs if is_done else trace.asked).add(paths[0])
        elif call in _OPEN:
            self._add_open(paths[0], arguments, is_done=is_done)
        elif call in _ASK:
            trace.asked.add(paths[0])
        elif is_done:
            trace.written.update(paths)

    def _add_open(self, path: str, arguments: str, *, is_done: bool) -> None:
        trace = self.trace
        flags = arguments.rpartition('"')[2]
        if not is_done:
            trace.asked.add(path)
        elif _TO_WRITE.search(flags):
            trace.written.add(path)
        elif "O_DIRECTORY" in flags:
            trace.listed.add(path)
        elif "O_PATH" in flags:
            trace.asked.add(path)
        else:
            trace.read.add(path)


def _text(quoted: str) -> str:
    """Return a path without the escapes of `strace`."""
    if "\\" not in quoted:
        return quoted
    data = _ESCAPE.sub(lambda match: _letter(match[1]), quoted)
    return os.fsdecode(data.encode("latin-1", errors="surrogateescape"))


def _letter(escape: str) -> str:
    return chr(int(escape, 8)) if escape[0] in "01234567" else _LETTERS.get(escape, escape)
