"""Runs a generator in a Python that has the fusesoc_firm package.

FuseSoC starts generators with the first `python3` on PATH. Unless an environment is activated, this may be neither
FuseSoC's own Python nor the one with this package. So a generator first looks for the right one. If the launcher of a
build starts this file itself, it prints the path of that Python, or nothing.

This file runs in any Python 3.9 or later.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator

# Modules that only a second start needs are imported late: most calls are hits and need to be fast.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from pathlib import Path
    from typing import NoReturn

_NEEDED = ("fusesoc_firm", "chevron", "rosbags", "yaml")
# If set, only this Python is used.
_CHOSEN = "FUSESOC_FIRM_PYTHON"
# Set for a further start: the Pythons that were tried and those that are left, one per line.
_TRIED, _LEFT = "_FUSESOC_FIRM_TRIED", "_FUSESOC_FIRM_LEFT"


def run(command: str) -> NoReturn:
    """Answer FuseSoC's call of the generator `command`, in this Python or in another that replaces this process."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # A script that starts FuseSoC in the background makes it ignore SIGINT.
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
            from fusesoc_firm.builds.call.answer import main

            sys.exit(main(command, sys.argv[1:]))
        if not tried:
            tried = [sys.executable]
            left = [] if chosen else _others(os.getppid())
        _start_next(command, tried, left)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)


def _warn_of_another_version(command: str) -> None:
    """Warn if this file's library and the package of this Python have different versions.

    The generated hardware requires the cores of the package's own library.
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
            f"{command}: warning: the library in {folder} has version {version}, but fusesoc-firm in {sys.prefix} has "
            f"version {__version__}\n      = 'firm path' prints the folder of the installed package's library",
            file=sys.stderr,
            flush=True,
        )


def _is_recalled(command: str) -> bool:
    """Whether the call is a hit."""
    try:
        from fusesoc_firm.builds.call.recall import answer
    except ImportError:
        return False
    return answer(command, sys.argv[1:])


def _start_next(command: str, tried: list[str], left: list[str]) -> NoReturn:
    """Start again in the next Python that may have the package, or end with a message.

    The package is not looked for beforehand, since this would itself start the other Python.
    """
    while left:
        tried.append(left.pop(0))
        environment = {**os.environ, _TRIED: "\n".join(tried), _LEFT: "\n".join(left)}
        try:
            os.execve(tried[-1], [tried[-1], *sys.argv], environment)
        except OSError:
            # It is not a program, or no longer exists.
            continue
    lines = "\n".join(f"  {python}" for python in tried)
    sys.exit(
        f"{command}: error: no Python with the packages {', '.join(_NEEDED)} was found. These were tried:\n{lines}\n"
        f"Install fusesoc-firm beside FuseSoC, activate an environment that contains fusesoc-firm, "
        f"or set {_CHOSEN} to the python3 of such an environment."
    )


def _others(parent: int) -> list[str]:
    """The other Pythons to try, in order; FuseSoC is the process `parent`."""
    return [python for python in dict.fromkeys(_candidates(parent)) if python != sys.executable]


def _candidates(parent: int) -> Iterator[str]:
    """Yield Pythons that may have the package, the likeliest first."""
    import shutil
    from pathlib import Path

    interpreter, script = _command(parent)
    # The parent may be a shell, for example, which does not understand Python's options.
    if Path(interpreter).name.startswith(("python", "pypy")) and (found := shutil.which(interpreter)):
        yield found
    for file in filter(None, (script, __file__)):
        yield from _environments_above(Path(file).absolute())
        yield from _environments_above(Path(file).resolve())


def _command(process: int) -> tuple[str, str]:
    """Interpreter and script of FuseSoC's process; "" if the system does not provide them."""
    from pathlib import Path

    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
        folder = Path(f"/proc/{process}/cwd").readlink()
    except OSError:
        return "", ""
    # Relative paths refer to the current folder of the process.
    absolute = [str(folder / word) if "/" in word else word for word in words]
    return absolute[0], next((word for word in absolute[1:] if "/" in word), "")


def _environments_above(path: Path) -> Iterator[str]:
    """The virtual environment that a file is installed in, and those named `.venv` in the folders above it."""
    for folder in path.parents:
        for environment in (folder, folder / ".venv"):
            if (environment / "pyvenv.cfg").is_file():
                yield str(environment / "bin" / "python3")


def _print_suitable() -> None:
    """Print, for a shell, the Python in which a generator would run, or nothing."""
    import shlex
    import subprocess

    # The current folder is excluded: `-c` can import from it, but a script cannot.
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
    """The process that started the make that runs this file, perhaps through several shells."""
    process = os.getppid()
    for name in ("sh", "make"):
        while (parent := _parent(process, name)) is not None:
            process = parent
    return process


def _parent(process: int, name: str) -> int | None:
    """The parent of a process if its program's name ends with `name`."""
    from pathlib import Path

    try:
        # The state and the parent follow the program's name, which may contain any character.
        program, _, rest = Path(f"/proc/{process}/stat").read_text(errors="replace").rpartition(")")
    except OSError:
        return None
    return int(rest.split()[1]) if program.endswith(name) else None


if __name__ == "__main__":
    _print_suitable()
