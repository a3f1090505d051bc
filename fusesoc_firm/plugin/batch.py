"""Makes what many generator calls will ask for, into the store, before FuseSoC makes them one after another.

    python -m fusesoc_firm.plugin.batch GENERATOR < calls.json

Such a process does the calls of one generator. The files of ours that it uses count for all of its calls, so an edit of
one may make more of them anew than it would have to, but none of another generator's. What cannot be made is left
alone: FuseSoC's own call makes it, or says what is wrong.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Generator as Steps
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from fusesoc_firm.plugin.gapi import (
    GENERATORS,
    MESSAGES,
    Call,
    Generator,
    MessageCores,
    make_request,
    obtain,
    used_before,
)
from fusesoc_firm.request.request import GeneratedCore, GeneratorCall, Request
from fusesoc_firm.store.own_code import digests
from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.text.render import forget_rendered

# So many are worth a process of their own.
_LEAST = 4
# The parameter that names cores with messages.
_OF_CORES = "messages"
# Modules that keep what took long to find out, and nothing rendered; `render` notes what it keeps.
_WITHOUT_TEMPLATES = ("store.own_code", "text.render", "request.core_reader", "store.store")


def prepare(calls: Iterable[GeneratorCall], jobs: int) -> Steps[None, None, None]:
    """Make them in at most `jobs` processes at once; a step for each call that was made, found or left alone.

    Whenever it is left, none of them runs on. Meanwhile this process imports what it takes to find such calls in the
    store, so that its copies need not.
    """
    ours = _ours(calls)
    for generator in dict.fromkeys(call.generator for call in ours):
        mine = [call for call in ours if call.generator == generator]
        count = min(jobs, len(mine) // _LEAST)
        yield from _run(generator, [mine[number::count] for number in range(count)], mine[0])


def _run(generator: str, shares: list[list[GeneratorCall]], first: GeneratorCall) -> Steps[None, None, None]:
    steps, end = os.pipe()
    processes = [
        subprocess.Popen(
            [sys.executable, "-m", __name__, generator],
            stdin=subprocess.PIPE,
            stdout=end,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        for _ in shares
    ]
    os.close(end)
    try:
        for process, share in zip(processes, shares, strict=True):
            assert process.stdin
            with process.stdin, suppress(BrokenPipeError):
                json.dump([vars(call) for call in share], process.stdin, default=str)
        _load(first)
        while done := os.read(steps, 100):
            yield from [None] * len(done)
    finally:
        os.close(steps)
        for process in processes:
            process.terminate()
            process.wait()


def _ours(calls: Iterable[GeneratorCall]) -> list[GeneratorCall]:
    """Those that can be answered before FuseSoC runs; only then is it known where the messages of other cores are."""
    return [
        call
        for call in calls
        if call.generator in GENERATORS and call.generator != MESSAGES and not call.parameters.get(_OF_CORES)
    ]


def _no_folders(names: MessageCores) -> tuple[Path, ...]:
    fail(f"there is no run that made the messages of {', '.join(names)}")


def _request(call: GeneratorCall) -> Request:
    generator = GENERATORS[call.generator]
    return make_request(call.generator, Call(call.vlnv, Path(call.files_root), call.parameters), generator, _no_folders)


def main() -> None:
    """Make the calls on standard input; a byte on standard output for each."""
    (name,) = sys.argv[1:]
    code = digests()
    for item in json.load(sys.stdin):
        _forget()
        with suppress(InputError):
            _make(GeneratorCall(**item), GENERATORS[name], code)
        os.write(sys.stdout.fileno(), b".")


def _forget() -> None:
    """Forget which templates were rendered, and all that our modules keep, which could be made of them."""
    forget_rendered()
    for name, module in [*sys.modules.items()]:
        package, _, rest = name.partition(".")
        if package == "fusesoc_firm" and rest not in _WITHOUT_TEMPLATES:
            for value in [*vars(module).values()]:
                if hasattr(value, "cache_clear"):
                    value.cache_clear()


def _make(call: GeneratorCall, generator: Generator, code: Mapping[str, str]) -> None:
    """Make a call in a process that has imported modules when our files were as `code` says.

    Raises `InputError`.
    """

    def generate(request: Request) -> GeneratedCore:
        core = generator.generate(request)
        if digests() != code:
            fail("a file of ours was edited since")
        return core

    obtain(_request(call), replace(generator, generate=generate))


def _load(call: GeneratorCall) -> None:
    """Import what it takes to find such a call in the store, which copies of this process then have."""
    with suppress(InputError):
        used_before(_request(call), GENERATORS[call.generator])


if __name__ == "__main__":
    main()
