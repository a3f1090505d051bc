"""What a newcomer may have meant by a command that does not exist."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import NoReturn

from fusesoc_firm.cli.common import Parser
from fusesoc_firm.text.diagnostics import Diagnostic, closest

# Words of other tools, each with the command lines, separated by bars, that do the same here.
GUESSES = {
    **dict.fromkeys(("create", "start", "project", "pkg", "quickstart", "tutorial"), "init NAME"),
    **dict.fromkeys(("add", "extend"), "init --extend SPEC"),
    **dict.fromkeys(("example", "examples", "demo"), "init --example NAME"),
    **dict.fromkeys(("validate", "verify", "lint"), "check"),
    **dict.fromkeys(("wave", "waves"), "sim --waves"),
    **dict.fromkeys(("launch", "bridge", "node", "ros2", "rosrun", "roslaunch"), "live"),
    **dict.fromkeys(("play", "bag"), "replay --in BAG --out BAG"),
    **dict.fromkeys(("gui", "ui", "page", "edit", "open", "view", "viz", "web", "serve", "dashboard"), "studio"),
    **dict.fromkeys(("msg", "messages", "types", "interface", "ls"), "message list"),
    **dict.fromkeys(("topic", "topics", "info"), "system show"),
    **dict.fromkeys(("generate", "gen", "codegen", "convert"), "init NAME|system core SPEC"),
    **dict.fromkeys(("core", "update", "upgrade"), "system core SPEC"),
    **dict.fromkeys(("draw", "plot"), "system diagram"),
    **dict.fromkeys(("install", "setup", "tools"), "doctor"),
    **dict.fromkeys(("pytest", "regress", "regression"), "test"),
    **dict.fromkeys(("compile", "synth", "synthesise", "synthesize", "implement", "pnr", "bit"), "bitstream"),
    **dict.fromkeys(("board", "boards", "area", "utilization"), "bitstream"),
    **dict.fromkeys(("upload", "download", "configure", "deploy"), "load"),
    **dict.fromkeys(("flash", "burn"), "load --flash"),
    "docs": "path --docs",
    "version": "--version",
}


def fail_unknown(word: str, parser: Parser) -> NoReturn:
    """End the program because of an unknown command, with the command lines that were probably meant."""
    found = dict.fromkeys(f"'firm {line}'" for line in _lines(word, parser))
    meant = f"did you mean {' or '.join(found)}? " if found else ""
    print(Diagnostic(f"unknown command '{word}'", hint=f"{meant}'firm help --all' lists all commands"), file=sys.stderr)
    sys.exit(2)


def _lines(word: str, parser: Parser) -> Iterator[str]:
    """Yield the command lines for a word: of other tools, an action of a group, or else the nearest command."""
    commands = parser.commands()
    actions = {name: group.commands() for name, group in commands.items() if isinstance(group, Parser)}
    lowered = word.lower()
    exact = [f"{name} {lowered}" for name, known in actions.items() if lowered in known]
    exact += GUESSES[lowered].split("|") if lowered in GUESSES else []
    yield from exact
    if not exact:
        # The usual name of a command with several names is that of its parser.
        lines = {**GUESSES, **{name: known.prog.removeprefix("firm ") for name, known in commands.items()}}
        near = closest(word, lines)
        yield from lines[near].split("|") if near else []
