"""Makes what many generator calls will ask for, into the store, before FuseSoC makes them one after another.

    python -m fusesoc_firm.plugin.batch GENERATOR < calls.json

Such a process does the calls of one generator, so it imports what they take once. What cannot be made is left alone:
FuseSoC's own call makes it, or says what is wrong.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Generator as Steps
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from fusesoc_firm.plugin.answer import Basis, load, obtain
from fusesoc_firm.plugin.generators import GENERATORS, MESSAGES
from fusesoc_firm.request.calls import make_request
from fusesoc_firm.request.request import GeneratorCall, Request
from fusesoc_firm.store.facts import facts
from fusesoc_firm.text.diagnostics import InputError, SourceRef, fail

# So many are worth a process of their own.
_LEAST = 4
# The parameter that names cores with messages.
_OF_CORES = "messages"


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


def _no_folders(names: Mapping[str, SourceRef | None]) -> tuple[Path, ...]:
    fail(f"no run generated the messages of {', '.join(names)}")


def _request(call: GeneratorCall) -> Request:
    return make_request(call, GENERATORS[call.generator].parameters, _no_folders)


def main() -> None:
    """Make the calls on standard input; a byte on standard output for each."""
    (name,) = sys.argv[1:]
    generator = GENERATORS[name]
    # The modules of the first call serve all others, so what is made is not kept if one of them was edited since.
    code = facts("code", [""])
    for item in json.load(sys.stdin):
        with suppress(InputError):
            request, basis = _request(GeneratorCall(**item)), Basis("", [*code])
            obtain(load(request, generator, basis), generator, basis)
        os.write(sys.stdout.fileno(), b".")


def _load(call: GeneratorCall) -> None:
    """Import what it takes to find such a call in the store, which copies of this process then have."""
    with suppress(InputError):
        GENERATORS[call.generator].load(_request(call))


if __name__ == "__main__":
    main()
