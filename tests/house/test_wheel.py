"""What the build of a wheel says to a user whose pip hides the output of builds."""

from __future__ import annotations

import os
import pty
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("has_page", [False, True])
def test_a_wheel_without_the_page_warns_on_the_terminal(tmp_path: Path, has_page: bool) -> None:
    for name in ("setup.py", "README.md", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    if has_page:
        page = tmp_path / "fusesoc_firm" / "studio" / "static" / "index.html"
        page.parent.mkdir(parents=True)
        page.touch()
    hidden = "import subprocess, sys; subprocess.run([sys.executable, 'setup.py', 'bdist_wheel', '--help'], "
    hidden += "stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)"
    process, terminal = pty.fork()
    if not process:
        os.chdir(tmp_path)
        os.execv(sys.executable, [sys.executable, "-c", hidden])
    shown = b""
    while part := _read(terminal):
        shown += part
    os.waitpid(process, 0)
    os.close(terminal)
    assert ("this wheel has no page for 'firm studio'" in shown.decode()) == (not has_page)


def _read(terminal: int) -> bytes:
    """What the terminal shows next; nothing at its end."""
    try:
        return os.read(terminal, 4096)
    except OSError:
        return b""
