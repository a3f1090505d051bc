"""Run a generator in a Python that has the fusesoc_firm package.

FuseSoC starts generators with the `python3` that is first on PATH. That need be neither the one FuseSoC runs in nor the
one this package was installed for, unless an environment is activated. So a generator first looks for the right one.
Started itself, by the launcher of a build, this file prints which one that is, or nothing.

This file runs in any Python 3.9 or later.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator

# What only a second start needs is imported for it: most calls are answered out of the store, at once.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from pathlib import Path
    from typing import NoReturn

_NEEDED = ("fusesoc_firm", "chevron", "rosbags", "yaml")
# Set to a Python to use just that.
_CHOSEN = "FUSESOC_FIRM_PYTHON"
# Set for a further start: the Pythons that were tried, and those that are left, both in lines.
_TRIED, _LEFT = "_FUSESOC_FIRM_TRIED", "_FUSESOC_FIRM_LEFT"


def run(command: str) -> NoReturn:
    """Answer FuseSoC's call of the generator `command`, in this Python or in another that takes this one's place."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # Whoever started FuseSoC in the background of a script had it ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    tried, left = ([*filter(None, os.environ.pop(name, "").split("\n"))] for name in (_TRIED, _LEFT))
    chosen = os.environ.get(_CHOSEN)
    try:
        if chosen and not tried and chosen != sys.executable:
            _start_next(command, [], [chosen])
        _warn_of_another_version(command)
        if _is_recalled(command):
            sys.exit(0)
        from importlib.util import find_spec

        if all(map(find_spec, _NEEDED)):
            from fusesoc_firm.plugin.answer import main

            sys.exit(main(command, sys.argv[1:]))
        if not tried:
            tried = [sys.executable]
            left = [] if chosen else _others(os.getppid())
        _start_next(command, tried, left)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)


def _warn_of_another_version(command: str) -> None:
    """Warn if the library that this file is in and the package of this Python have different versions.

    The hardware that is generated is made for the cores of the package's own library.
    """
    folder = os.path.dirname(os.path.abspath(__file__))
    try:
        from fusesoc_firm import __version__

        with open(os.path.join(folder, "generators.core"), encoding="utf-8") as core:
            name = next((line for line in core if line.startswith("name:")), "")
    except (ImportError, OSError):
        return
    version = name.strip().rpartition(":")[2]
    if version != __version__:
        print(
            f"{command}: warning: the library in {folder} is of version {version}, fusesoc-firm in {sys.prefix} of "
            f"{__version__}\n      = 'firm path' prints the folder of the installed package's library",
            file=sys.stderr,
            flush=True,
        )


def _is_recalled(command: str) -> bool:
    """Tell whether the call was answered as it was answered before."""
    try:
        from fusesoc_firm.plugin.recall import answer
    except ImportError:
        return False
    return answer(command, sys.argv[1:])


def _start_next(command: str, tried: list[str], left: list[str]) -> NoReturn:
    """Start again in the next Python that may have the package, or end with a message.

    It is not asked beforehand whether it has: that would take a start by itself.
    """
    while left:
        tried.append(left.pop(0))
        environment = {**os.environ, _TRIED: "\n".join(tried), _LEFT: "\n".join(left)}
        try:
            os.execve(tried[-1], [tried[-1], *sys.argv], environment)
        except OSError:
            # It is no program, or is no more.
            continue
    lines = "\n".join(f"  {python}" for python in tried)
    sys.exit(
        f"{command}: error: no Python with the packages {', '.join(_NEEDED)} was found. These were tried:\n{lines}\n"
        f"Install fusesoc-firm beside FuseSoC, activate the environment that has it, or set {_CHOSEN} to its python3."
    )


def _others(parent: int) -> list[str]:
    """What to try beside this Python, in order, where FuseSoC is the process `parent`."""
    return [python for python in dict.fromkeys(_candidates(parent)) if python != sys.executable]


def _candidates(parent: int) -> Iterator[str]:
    """Pythons that may have the package, the likeliest first."""
    import shutil
    from pathlib import Path

    interpreter, script = _command(parent)
    # Where no Python but, say, a shell is the parent, it is not to be asked what only Python understands.
    if Path(interpreter).name.startswith(("python", "pypy")) and (found := shutil.which(interpreter)):
        yield found
    for file in filter(None, (script, __file__)):
        yield from _environments_above(Path(file).absolute())
        yield from _environments_above(Path(file).resolve())


def _command(process: int) -> tuple[str, str]:
    """Interpreter and script of a process, which is FuseSoC; "" where the system does not tell."""
    from pathlib import Path

    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
        folder = Path(f"/proc/{process}/cwd").readlink()
    except OSError:
        return "", ""
    # A relative path is meant from where the process stands.
    absolute = [str(folder / word) if "/" in word else word for word in words]
    return absolute[0], next((word for word in absolute[1:] if "/" in word), "")


def _environments_above(path: Path) -> Iterator[str]:
    """The virtual environment that a file is installed in, and those named `.venv` in the folders above it."""
    for folder in path.parents:
        for environment in (folder, folder / ".venv"):
            if (environment / "pyvenv.cfg").is_file():
                yield str(environment / "bin" / "python3")


def _print_suitable() -> None:
    """Print, for a shell, the Python that a generator would run in; nothing if there is none."""
    import shlex
    import subprocess

    # Without the current folder, which `-c` can import from and a script cannot.
    probe = f"""
import sys
from importlib.util import find_spec
sys.path = [folder for folder in sys.path if folder]
sys.exit(not all(map(find_spec, {_NEEDED})))
"""
    chosen = os.environ.get(_CHOSEN)
    for python in [chosen] if chosen else [sys.executable, *_others(_above_make())]:
        try:
            is_suitable = subprocess.run([python, "-c", probe], stderr=subprocess.DEVNULL, check=False).returncode == 0
        except OSError:
            continue
        if is_suitable:
            print(shlex.quote(python))
            return


def _above_make() -> int:
    """The process that started the make in whose makefile this one is, maybe below several shells."""
    process = os.getppid()
    for name in ("sh", "make"):
        while (parent := _parent(process, name)) is not None:
            process = parent
    return process


def _parent(process: int, name: str) -> int | None:
    """The parent of a process if its program's name ends with `name`."""
    from pathlib import Path

    try:
        # After the program's name, which may hold anything: its state, its parent.
        program, _, rest = Path(f"/proc/{process}/stat").read_text(errors="replace").rpartition(")")
    except OSError:
        return None
    return int(rest.split()[1]) if program.endswith(name) else None


if __name__ == "__main__":
    _print_suitable()
