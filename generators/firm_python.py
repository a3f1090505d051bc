"""Run a generator in a Python that has the fusesoc_firm package.

FuseSoC starts generators with the `python3` that is first on PATH. That need be neither the one FuseSoC runs in nor the
one this package was installed for, unless an environment is activated. So a generator first looks for the right one.

This file runs in any Python 3.9 or later.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

# What only a second start needs is imported for it: most calls are answered out of the store, at once.
TYPE_CHECKING = False
if TYPE_CHECKING:
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
    is_restarted = bool(os.environ.pop(_RESTARTED, ""))
    try:
        if (is_restarted or not os.environ.get(_CHOSEN)) and _is_recalled(command):
            sys.exit(0)
        if not is_restarted:
            _restart_if_needed(command)
        from fusesoc_firm.gapi import main
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    sys.exit(main(command, sys.argv[1:]))


def _is_recalled(command: str) -> bool:
    """Tell whether the call was answered as it was answered before."""
    try:
        from fusesoc_firm.recall import answer
    except ImportError:
        return False
    return answer(command, sys.argv[1:])


def _restart_if_needed(command: str) -> None:
    """Return if this Python will do; else start again in one that does, or end with a message."""
    from importlib.util import find_spec

    chosen = os.environ.get(_CHOSEN)
    if not chosen and all(map(find_spec, _NEEDED)):
        return
    pythons = [chosen] if chosen else list(dict.fromkeys([sys.executable, *_candidates()]))
    for python in pythons[0 if chosen else 1 :]:
        if _is_suitable(python):
            os.execve(python, [python, *sys.argv], {**os.environ, _RESTARTED: "1"})
    tried = "\n".join(f"  {python}" for python in pythons)
    sys.exit(
        f"{command}: error: no Python with the packages {', '.join(_NEEDED)} was found. These were tried:\n{tried}\n"
        f"Install fusesoc-firm beside FuseSoC, activate the environment that has it, or set {_CHOSEN} to its python3."
    )


def _candidates() -> Iterator[str]:
    """Pythons that may have the package, the likeliest first."""
    import shutil
    from pathlib import Path

    interpreter, script = _parent_command()
    # Where no Python but, say, a shell is the parent, it is not to be asked what only Python understands.
    if Path(interpreter).name.startswith(("python", "pypy")) and (found := shutil.which(interpreter)):
        yield found
    for file in filter(None, (script, __file__)):
        yield from _environments_above(Path(file).absolute())
        yield from _environments_above(Path(file).resolve())


def _parent_command() -> tuple[str, str]:
    """Interpreter and script of FuseSoC, the process that started this one; "" where the system does not tell."""
    from pathlib import Path

    try:
        words = Path(f"/proc/{os.getppid()}/cmdline").read_bytes().decode(errors="replace").split("\0")
        folder = Path(f"/proc/{os.getppid()}/cwd").readlink()
    except OSError:
        return "", ""
    # A relative path is meant from where the parent stands.
    absolute = [str(folder / word) if "/" in word else word for word in words]
    return absolute[0], next((word for word in absolute[1:] if "/" in word), "")


def _environments_above(path: Path) -> Iterator[str]:
    """The virtual environment that a file is installed in, and those named `.venv` in the folders above it."""
    for folder in path.parents:
        for environment in (folder, folder / ".venv"):
            if (environment / "pyvenv.cfg").is_file():
                yield str(environment / "bin" / "python3")


def _is_suitable(python: str) -> bool:
    import subprocess

    try:
        return subprocess.run([python, "-c", _PROBE], stderr=subprocess.DEVNULL, check=False).returncode == 0
    except OSError:
        return False
