"""Makes what many generator calls will ask for, into the store, before FuseSoC makes them one after another.

    python -m fusesoc_firm.batch GENERATOR < calls.json

Such a process does the calls of one generator, so that it uses the files of ours that a call by itself would use, and
none of another one's. What it cannot make it leaves alone: FuseSoC's own call makes it, or says what is wrong.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Generator, Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from fusesoc_firm.diagnostics import InputError, fail
from fusesoc_firm.gapi import GENERATORS, MESSAGES, Call, make_request, obtain, used_before
from fusesoc_firm.generation import GeneratedCore, GeneratorCall, Request
from fusesoc_firm.own_code import digests
from fusesoc_firm.render import forget_templates

# So many are worth a process of their own.
_LEAST = 4
# The parameter that names cores with messages.
_OF_CORES = "messages"


def prepare(calls: Iterable[GeneratorCall], jobs: int) -> Generator[None, None, None]:
    """Make them in at most `jobs` processes at once; a step for each call that was made, found or left alone.

    Whenever it is left, none of them runs on. Meanwhile this process imports what it takes to find such calls in the
    store, so that its copies need not.
    """
    ours = _ours(calls)
    for generator in dict.fromkeys(call.generator for call in ours):
        mine = [call for call in ours if call.generator == generator]
        count = min(jobs, len(mine) // _LEAST)
        yield from _run(generator, [mine[number::count] for number in range(count)], mine[0])


def _run(generator: str, shares: list[list[GeneratorCall]], first: GeneratorCall) -> Generator[None, None, None]:
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
        with suppress(InputError):
            used_before(_request(first), GENERATORS[generator])
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


def _request(call: GeneratorCall) -> Request:
    known = GENERATORS[call.generator].parameters
    return make_request(call.generator, Call(call.vlnv, Path(call.files_root), call.parameters), known, lambda _: ())


def main() -> None:
    """Make the calls on standard input; a byte on standard output for each."""
    (name,) = sys.argv[1:]
    generator = GENERATORS[name]
    code = digests()

    def generate(request: Request) -> GeneratedCore:
        core = generator.generate(request)
        if digests() != code:
            fail("a file of ours was edited, which this process has read before")
        return core

    for item in json.load(sys.stdin):
        forget_templates()
        with suppress(InputError):
            obtain(_request(GeneratorCall(**item)), replace(generator, generate=generate))
        os.write(sys.stdout.fileno(), b".")


if __name__ == "__main__":
    main()
