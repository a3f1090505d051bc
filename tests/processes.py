"""How tests start programs."""

IGNORING_INTERRUPTS = ("/bin/sh", "-c", 'trap "" INT; exec "$@"', "sh")
"""Before a command: it is started as by a script in its background, with SIGINT ignored."""


def limited(seconds: float) -> tuple[str, ...]:
    """Before a command: it is killed when it has worked for so long. How long it waits does not count."""
    return ("prlimit", f"--cpu={seconds:.0f}", "--")
