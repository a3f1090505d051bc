"""Which run of FuseSoC this is, and which generated folders hold the messages of a core, made in this run.

What an earlier run left there is told by a mark in the folder, which names the core and the run that made it. Of
Python's library no more is imported than that needs.
"""

from __future__ import annotations

import os

from fusesoc_firm.text.files import read_file, write_whole

_MARK = "firm_messages.run"


def mark_run(folder: str, core: str) -> None:
    """Note in a generated core's folder whose messages these are, and that this run of FuseSoC made it."""
    write_whole(os.path.join(folder, _MARK), f"{core}\n{run_of(os.getppid())}".encode())


def marked_folders(generated: str, core: str, *, is_this_run: bool = True) -> list[str]:
    """The folders in `generated` with the messages of a core (`vendor:library:name`), sorted.

    Unless it `is_this_run`, those of any run.
    """
    try:
        names = sorted(os.listdir(generated))
    except OSError:
        return []
    folders = [os.path.join(generated, name) for name in names]
    return [folder for folder in folders if _is_of(folder, core, is_this_run)]


def _is_of(folder: str, core: str, is_this_run: bool) -> bool:
    found, _, run = (read_file(os.path.join(folder, _MARK)) or b"").decode(errors="replace").partition("\n")
    return found == core and (not is_this_run or run == run_of(os.getppid()))


def run_of(fusesoc: int) -> str:
    """What tells the run that this process of FuseSoC is from all others on this machine."""
    # When it was started, behind the name in parentheses, which may hold blanks.
    status = (read_file(f"/proc/{fusesoc}/stat") or b"").decode(errors="replace")
    return f"{fusesoc} {''.join(status.rpartition(')')[2].split()[19:20])}"
