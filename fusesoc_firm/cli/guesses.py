"""What a newcomer may have meant by a command that does not exist."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentParser
from collections.abc import Iterator, Mapping
from typing import NoReturn

from fusesoc_firm.cli.common import Parser
from fusesoc_firm.text.diagnostics import Diagnostic, closest

# How similar a misspelt command is to the one that was meant: a word of another meaning must not be.
_MISSPELT = 0.8
# The shortest word that counts as a part of another one.
_SHORTEST = 4
_MOST_DESCRIBED = 2
# Words of other tools, each with the command lines, separated by bars, that do the same here.
GUESSES = {
    **dict.fromkeys(("create", "start", "project", "pkg", "quickstart", "tutorial", "scaffold"), "init NAME"),
    **dict.fromkeys(("add", "extend"), "init --extend SPEC"),
    **dict.fromkeys(("example", "examples", "demo", "clone", "copy"), "init --example NAME"),
    **dict.fromkeys(("validate", "verify", "lint", "parse"), "check"),
    **dict.fromkeys(("wave", "waves"), "sim --waves"),
    **dict.fromkeys(("latency", "cycles", "speed", "execute", "exec"), "sim"),
    **dict.fromkeys(("log", "logs", "verbose", "debug"), "sim --verbose"),
    **dict.fromkeys(("launch", "bridge", "node", "ros2", "rosrun", "publish", "subscribe", "send"), "live"),
    **dict.fromkeys(("echo", "monitor", "watch", "listen", "sample", "capture", "hz", "rate"), "live --watch"),
    **dict.fromkeys(("play", "bag"), "replay --in BAG --out BAG"),
    **dict.fromkeys(("gui", "ui", "page", "edit", "open", "view", "viz", "visual", "web", "serve", "wire"), "studio"),
    "dashboard": "studio",
    **dict.fromkeys(("msg", "messages", "types", "interface", "ls"), "message list"),
    **dict.fromkeys(("topic", "topics", "info", "inspect", "ports"), "system show"),
    **dict.fromkeys(("generate", "gen", "codegen", "convert"), "init NAME|system core SPEC"),
    **dict.fromkeys(("core", "update", "upgrade", "package", "ip"), "system core SPEC"),
    **dict.fromkeys(("draw", "plot", "pinout", "pins", "schematic"), "system diagram"),
    **dict.fromkeys(("install", "setup", "tools"), "doctor"),
    **dict.fromkeys(("pytest", "regress", "regression"), "test"),
    **dict.fromkeys(("compile", "synth", "synthesise", "synthesize", "implement", "pnr", "route"), "bitstream"),
    **dict.fromkeys(("board", "boards", "area", "usage", "timing", "fmax", "resources", "estimate"), "bitstream"),
    "utilization": "bitstream",
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
    if not found:
        print(f"\n{parser.epilog}", file=sys.stderr)
    sys.exit(2)


def _lines(word: str, parser: Parser) -> Iterator[str]:
    """Yield the command lines for a word: an action of a group, or a word of other tools.

    Else it is the nearest command, or those whose names or descriptions contain the word.
    """
    commands = parser.commands()
    actions = {name: group.commands() for name, group in commands.items() if isinstance(group, Parser)}
    lowered = word.lower()
    exact = [f"{name} {lowered}" for name, known in actions.items() if lowered in known]
    exact += GUESSES[lowered].split("|") if lowered in GUESSES else []
    yield from exact
    if not exact:
        lines = {name: f"{group} {name}" for group, known in actions.items() for name in known} | GUESSES
        # The usual name of a command with several names is that of its parser.
        lines |= {name: known.prog.removeprefix("firm ") for name, known in commands.items()}
        near = closest(word, lines, _MISSPELT) or next((name for name in lines if _is_part(name, lowered)), "")
        yield from lines[near].split("|") if near else _described(lowered, commands, actions)


def _is_part(one: str, other: str) -> bool:
    return min(len(one), len(other)) >= _SHORTEST and (one in other or other in one)


def _described(
    word: str, commands: Mapping[str, ArgumentParser], actions: Mapping[str, Mapping[str, ArgumentParser]]
) -> list[str]:
    """Return the first commands or actions whose descriptions contain a word or its beginning."""
    parsers = [*commands.values(), *(item for group in actions.values() for item in group.values())]
    found = [
        item.prog.removeprefix("firm ")
        for item in parsers
        for own in re.findall(r"\w+", str(item.description).lower())
        if _is_part(own, word) and own[0] == word[0]
    ]
    return [*dict.fromkeys(found)][:_MOST_DESCRIBED]
