"""Run a step with bubblewrap (`bwrap`), so that only its inputs, the machine's tools and its own folder exist.

A step in the sandbox sees all places at their usual paths, so its outputs are those of a step outside. Tools are
read-only, and a separate loopback device is the only network. Other files, such as those beside a build's folder, do
not exist.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from fusesoc_firm.builds.step.places import Places
from fusesoc_firm.text.diagnostics import fail

_PROGRAM = "bwrap"
_NEW_ROOT = ("--unshare-user-try", "--unshare-ipc", "--unshare-pid", "--unshare-net", "--die-with-parent")
_SYSTEM = ("--proc", "/proc", "--dev", "/dev", "--ro-bind", "/etc", "/etc", "--tmpfs", "/tmp")
_INSTALL = "on Debian and Ubuntu: apt install bubblewrap; some containers do not permit namespaces"


def can_sandbox() -> bool:
    """Return whether steps can run in a sandbox on this machine."""
    return not _obstacle()


def check_sandbox() -> None:
    """Raise `InputError` with the reason if steps cannot run in a sandbox on this machine."""
    if reason := _obstacle():
        fail(f"--sandbox is not available here: {reason}", hint=_INSTALL)


@cache
def _obstacle() -> str:
    if shutil.which(_PROGRAM) is None:
        return f"'{_PROGRAM}' is not installed"
    command = [_PROGRAM, *_NEW_ROOT, "--ro-bind", "/", "/", *_SYSTEM, "true"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stderr.strip() if done.returncode else ""


def sandboxed(places: Places, *further: Path) -> list[str]:
    """Return the beginning of a command line that runs a step in these places; `further` folders are writable."""
    return [_PROGRAM, *_NEW_ROOT, *_SYSTEM, *_options(places, further), "--chdir", places.folder, "--"]


def _options(places: Places, further: tuple[Path, ...]) -> Iterator[str]:
    # A place comes after the places that contain it, which would cover it.
    for path in sorted({*places.tools, *places.declared}):
        if Path(path).is_symlink() and Path(path).parent == Path("/"):
            # For example /bin, a link to a folder in /usr.
            yield from ("--symlink", str(Path(path).readlink()), path)
        else:
            yield from ("--ro-bind-try", path, path)
    for path in places.caches:
        yield from ("--bind-try", path, path)
    for path in (places.folder, places.temporary, *map(str, further)):
        yield from ("--bind", path, path)
    if places.home:
        yield from ("--dir", places.home)
    # Otherwise, parent folders of bound folders would be writable, and lost at the end.
    yield from ("--remount-ro", "/")
