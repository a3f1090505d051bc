"""Run a generator in a Python that has the fusesoc_firm package.

FuseSoC starts generators with the `python3` that is first on PATH. That need be neither the one FuseSoC runs in nor the
one this package was installed for, unless an environment is activated. So a generator first looks for the right one.
Started itself, by the makefile of a build, this file prints which one that is, or nothing.

This file runs in any Python 3.9 or later.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn

_NEEDED = ("fusesoc_firm", "chevron", "rosbags", "yaml")
# Without the current folder, which `-c` can import from and a script cannot.
_PROBE = f"""
import sys
from importlib.util import find_spec
sys.path = [folder for folder in sys.path if folder]
sys.exit(not all(map(find_spec, {_NEEDED})))
"""
# Set to a Python to use just that.
_CHOSEN = "FUSESOC_FIRM_PYTHON"
# Set for the second start, so that there is no third.
_RESTARTED = "_FUSESOC_FIRM_RESTARTED"


def run(command: str) -> NoReturn:
    """Answer FuseSoC's call of the generator `command`, in this Python or in another that takes this one's place."""
    is_restarted = os.environ.pop(_RESTARTED, "")
    if not is_restarted:
        _restart_if_needed(command)
    from fusesoc_firm.gapi import main

    sys.exit(main(command, sys.argv[1:]))


def _restart_if_needed(command: str) -> None:
    """Return if this Python will do; else start again in one that does, or end with a message."""
    pythons = _pythons(os.getppid())
    python = next(filter(_is_suitable, pythons), None)
    if python == sys.executable:
        return
    if python:
        os.execve(python, [python, *sys.argv], {**os.environ, _RESTARTED: "1"})
    tried = "\n".join(f"  {python}" for python in pythons)
    sys.exit(
        f"{command}: error: no Python with the packages {', '.join(_NEEDED)} was found. These were tried:\n{tried}\n"
        f"Install fusesoc-firm beside FuseSoC, activate the environment that has it, or set {_CHOSEN} to its python3."
    )


def _pythons(parent: int) -> list[str]:
    """What to try, in order, where FuseSoC is the process `parent`."""
    chosen = os.environ.get(_CHOSEN)
    return [chosen] if chosen else list(dict.fromkeys([sys.executable, *_candidates(parent)]))


def _candidates(parent: int) -> Iterator[str]:
    """Pythons that may have the package, the likeliest first."""
    interpreter, script = _command(parent)
    # Where no Python but, say, a shell is the parent, it is not to be asked what only Python understands.
    if Path(interpreter).name.startswith(("python", "pypy")) and (found := shutil.which(interpreter)):
        yield found
    for file in filter(None, (script, __file__)):
        yield from _environments_above(Path(file).absolute())
        yield from _environments_above(Path(file).resolve())


def _command(process: int) -> tuple[str, str]:
    """Interpreter and script of a process, which is FuseSoC; "" where the system does not tell."""
    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
        folder = Path(f"/proc/{process}/cwd").readlink()
    except OSError:
        return "", ""
    # A relative path is meant from where the process stands.
    absolute = [str(folder / word) if "/" in word else word for word in words]
    return absolute[0], next((word for word in absolute[1:] if "/" in word), "")


def _above_make() -> int:
    """The process that started the make in whose makefile this one is, maybe by a shell."""
    process = os.getppid()
    for name in ("sh", "make"):
        try:
            # Behind the program's name, which may hold anything: its state, its parent.
            program, _, rest = Path(f"/proc/{process}/stat").read_text(errors="replace").rpartition(")")
        except OSError:
            break
        if program.endswith(name):
            process = int(rest.split()[1])
    return process


def _environments_above(path: Path) -> Iterator[str]:
    """The virtual environment that a file is installed in, and those named `.venv` in the folders above it."""
    for folder in path.parents:
        for environment in (folder, folder / ".venv"):
            if (environment / "pyvenv.cfg").is_file():
                yield str(environment / "bin" / "python3")


def _is_suitable(python: str) -> bool:
    if python == sys.executable:
        return all(map(find_spec, _NEEDED))
    try:
        return subprocess.run([python, "-c", _PROBE], stderr=subprocess.DEVNULL, check=False).returncode == 0
    except OSError:
        return False


if __name__ == "__main__":
    for found in filter(_is_suitable, _pythons(_above_make())):
        print(shlex.quote(found))
        break
