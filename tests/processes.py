"""How tests start programs."""

import sys
from pathlib import Path

IGNORING_INTERRUPTS = ("/bin/sh", "-c", 'trap "" INT; exec "$@"', "sh")
"""Before a command: it is started as by a script in its background, with SIGINT ignored."""


def program(name: str) -> str:
    """Return the path of a command of this Python's packages, `firm` or `fusesoc`.

    `python -m` also has the working folder on its path: what is new there would change the inputs of a build.
    """
    return str(Path(sys.executable).with_name(name))


def limited(seconds: float) -> tuple[str, ...]:
    """Before a command: it is killed when it has worked for so long. How long it waits does not count."""
    return ("prlimit", f"--cpu={seconds:.0f}", "--")
