"""`firm completion`: print the code with which a shell completes commands."""

from __future__ import annotations

import argparse
from typing import Any

from fusesoc_firm.cli.common import command


def add_completion(commands: Any) -> None:
    """Declare the command."""
    completion = command(
        commands,
        "completion",
        "print the code with which a shell completes commands, options and their values",
        'eval "$(firm completion bash)"',
        _print_completion,
    )
    completion.add_argument("shell", choices=("bash", "zsh", "fish"), help="the shell")


def _print_completion(arguments: argparse.Namespace) -> None:
    from argcomplete.shell_integration import shellcode

    print(shellcode(["firm"], shell=arguments.shell), end="")
