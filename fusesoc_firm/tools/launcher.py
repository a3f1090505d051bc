"""Start the programs of a build for Edalize, like `firm tool`.

Edalize's makefiles prefix each program with the launcher. The launcher finds a program on the path or in YoWASP's
package from PyPI, reports how to install a missing program, and records each program that ran in the build's manifest.
The launcher also removes the output of a failed program, such as the layout that nextpnr writes before it finds that
the clock is too slow; otherwise, make would accept this output in the next run.

`generators/launcher.mk` is the GNUmakefile of a build. Unless another launcher is set, the makefile uses the adjacent
`firm_launcher.sh`, which starts this module for the first run of each program in a build.
"""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.tools.interrupts import accept_interrupts
from fusesoc_firm.tools.verilator_package import provide_verilator

# The options that precede the name of an output file.
_OUTPUTS = ("--asc", "--textcfg", "--write")
# Variables from `firm_launcher.sh`: the file with the path of a program that is in the manifest, the user's note of the
# program, and the settings that determine the package's Python.
_NOTED, _NOTE, _ENVIRONMENT = "FIRM_NOTED", "FIRM_NOTE", "FIRM_ENVIRONMENT"
# The file in the temporary folder in which `launch.sh` records the names of programs.
_LAUNCHED = "firm_launched"
# The maximum delay of a file system's clock.
_TICK_NANOSECONDS = 20 * 10**6


def launch(program: str, arguments: Sequence[str], user_note: Path | None = None, environment: str = "") -> int:
    """Run a program until it ends, and return the exit status. Raise `InputError` if the program is not installed.

    `user_note` is the file with the program's manifest entries for other builds in this `environment`.
    """
    from fusesoc_firm.tools.manifest import note, note_for_other_builds
    from fusesoc_firm.tools.programs import find, ways

    started = time.time_ns() - _TICK_NANOSECONDS
    path = find(program)
    if path is None:
        fail(f"the program '{program}' is not installed", hint=ways(program))
    status = _run([str(path), *arguments])
    entries = note(program, Path())
    # A program beside the interpreter depends on this Python.
    if user_note and entries and shutil.which(program) and path.is_absolute():
        note_for_other_builds(user_note, environment, path, entries, started)
    if status:
        for option, value in pairwise(arguments):
            if option in _OUTPUTS:
                Path(value).unlink(missing_ok=True)
    # After a signal, use the exit status that a shell would use.
    return status if status >= 0 else 128 - status


def _run(command: Sequence[str]) -> int:
    """Run a command and return the exit status; if make terminates this process, terminate the command."""
    program: subprocess.Popen[bytes] | None = None
    is_wanted = True

    def end(*_: object) -> None:
        nonlocal is_wanted
        is_wanted = False
        if program:
            program.terminate()

    before = signal.signal(signal.SIGTERM, end)
    try:
        with subprocess.Popen(command) as program:
            # The signal may have arrived while the command was being started.
            if not is_wanted:
                program.terminate()
            return program.wait()
    finally:
        signal.signal(signal.SIGTERM, before)


def _leave_to_the_shell(arguments: Sequence[str], noted: Path) -> None:
    """Let `firm_launcher.sh` start a program from now on, unless output must be removed after a failure."""
    if not any(option in arguments for option in _OUTPUTS) and (path := shutil.which(arguments[0])):
        noted.parent.mkdir(exist_ok=True)
        noted.write_text(f"{path}\n", encoding="utf-8")


def starts_everything() -> bool:
    """Return whether this package's launcher starts the build's programs; other launchers may find other programs."""
    words = os.environ.get("EDALIZE_LAUNCHER", "").split()
    return not words or words[-1] in {"tool", __name__}


def launcher_of_steps() -> str:
    """Return the launcher for a step whose result is stored: `launch.sh`, which starts this module if necessary."""
    script = Path(__file__).with_name("launch.sh")
    return shlex.join(["sh", str(script), sys.executable, "-m", "fusesoc_firm.tools.launcher"])


def note_launched(temporary: Path, folder: Path) -> None:
    """Record the programs that `launch.sh` has started with this TMPDIR in the folder's manifest."""
    from fusesoc_firm.tools.manifest import note

    with suppress(FileNotFoundError):
        for program in dict.fromkeys((temporary / _LAUNCHED).read_text(encoding="utf-8").split()):
            note(program, folder)


def main(arguments: Sequence[str]) -> int:
    """Run `firm tool` without loading the other commands, since a build starts about a dozen programs."""
    accept_interrupts()
    is_provided = provide_verilator(os.environ)
    noted, user_note, environment = (os.environ.pop(name, "") for name in (_NOTED, _NOTE, _ENVIRONMENT))
    try:
        status = launch(arguments[0], arguments[1:], Path(user_note) if user_note else None, environment)
        # The shell would start make and Verilator without the package's settings.
        if noted and not is_provided:
            _leave_to_the_shell(arguments, Path(noted))
        return status
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
