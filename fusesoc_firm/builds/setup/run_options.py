"""Options of `fusesoc run` that a user gives for all builds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.text.diagnostics import fail

BACKEND = "--"
"""Separates the options of `fusesoc run` from the arguments for the backend, which follow the core's name there."""

_FILTER = "--filter"


@dataclass(frozen=True)
class RunOptions:
    """The options of `fusesoc run`; `words` are options that are passed on unchanged, `backend` those of tools."""

    flags: tuple[str, ...] = ()
    tool: str = ""
    mappings: tuple[str, ...] = ()
    lock_file: Path | None = None
    words: tuple[str, ...] = ()
    backend: tuple[str, ...] = ()

    def options(self) -> tuple[str, ...]:
        """Return the options for the command line of `fusesoc run`, then the backend's."""
        return (*self._options(), *((BACKEND, *self.backend) if self.backend else ()))

    def command_line(self) -> tuple[str, ...]:
        """Return the options for the command line of `firm build`."""
        return (*self._options(), *(f"--backend={word}" for word in self.backend))

    def use_flags(self) -> dict[str, bool | str]:
        """Return the flags that FuseSoC derives from these options."""
        flags: dict[str, bool | str] = {"tool": self.tool} if self.tool else {}
        return flags | {flag.lstrip("+-"): not flag.startswith("-") for flag in self.flags}

    def apply(self, fusesoc: Any) -> None:
        """Let mappings and lock file apply to a FuseSoC instance, which is possible once. May raise `InputError`."""
        try:
            fusesoc.cm.db.mapping_set(self.mappings)
            if self.lock_file:
                if not self.lock_file.is_file():
                    fail(f"there is no lock file {self.lock_file}")
                fusesoc.cm.db.load_lockfile(self.lock_file, disable_store=True)
        except (RuntimeError, SyntaxError) as error:
            fail(str(error))

    def configure(self, config: Any) -> None:
        """Set the options that FuseSoC keeps in its configuration, where the builds of this process find them."""
        for word in self.words:
            name, _, value = word.partition("=")
            key = f"args_{name.removeprefix('--').replace('-', '_')}"
            if name == _FILTER:
                config.args_filters = [*getattr(config, "args_filters", []), value]
            else:
                setattr(config, key, value or True)

    def _options(self) -> Iterator[str]:
        # Option and value are joined, since a flag's value may begin with a dash.
        yield from (f"--flag={flag}" for flag in self.flags)
        yield from [f"--tool={self.tool}"] * bool(self.tool)
        yield from (f"--mapping={name}" for name in self.mappings)
        if self.lock_file:
            yield f"--lockfile={self.lock_file.absolute()}"
        yield from self.words


def split(options: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the options before and after the separator."""
    place = [*options, BACKEND].index(BACKEND)
    return [*options[:place]], [*options[place + 1 :]]
