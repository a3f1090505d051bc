"""Generate the cores of many calls in advance and in parallel, since FuseSoC generates them one after another.

    python -m fusesoc_firm.plugin.batch GENERATOR < calls.json

This process handles the calls of one generator, so it imports that generator's modules only once. Calls that fail are
skipped: FuseSoC's own call then generates the core or reports the faults.
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

import yaml
from fusesoc.utils import YamlDumper

from fusesoc_firm.plugin.answer import Basis, fulfil
from fusesoc_firm.plugin.generators import GENERATORS, MESSAGES
from fusesoc_firm.request.calls import make_request
from fusesoc_firm.request.request import GeneratorCall, Request
from fusesoc_firm.store.facts import facts
from fusesoc_firm.text.diagnostics import InputError, SourceRef, fail

# The minimum number of calls that justifies a process.
_LEAST = 4
# The parameter that lists message cores.
_OF_CORES = "messages"


def prepare(calls: Iterable[GeneratorCall], jobs: int) -> Steps[None, None, None]:
    """Process calls in at most `jobs` processes; yield once for each call that is generated, cached or skipped.

    On exit, all processes are ended. While they run, this process imports the modules needed to look calls up in the
    store, so that its copies need not import them.
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
    """Return the calls of our generators, except calls with message cores, whose folders FuseSoC's run determines."""
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
    """Process the calls on standard input; write a byte to standard output for each."""
    (name,) = sys.argv[1:]
    generator = GENERATORS[name]
    # All calls use the modules that the first call imported, so results are not stored if a module was edited since
    # then.
    code = facts("code", [""])
    for item in json.load(sys.stdin):
        with suppress(InputError):
            call = GeneratorCall(**item)
            fulfil(_request(call), generator, Basis("", [*code]), _file_of(call))
        os.write(sys.stdout.fileno(), b".")


def _file_of(call: GeneratorCall) -> bytes:
    """Return FuseSoC's file for a call. If a release of FuseSoC writes another one, the call's note is not used."""
    content = {"files_root": call.files_root, "gapi": "1.0", "parameters": call.parameters, "vlnv": call.vlnv}
    return yaml.dump(content, Dumper=YamlDumper, sort_keys=False).encode()


def _load(call: GeneratorCall) -> None:
    """Import the modules that look a call up in the store, for copies of this process."""
    with suppress(InputError):
        GENERATORS[call.generator].load(_request(call))


if __name__ == "__main__":
    main()
