"""Generate the cores of many calls in advance and in parallel, since FuseSoC generates them one after another.

    python -m fusesoc_firm.builds.call.batch GENERATOR PROCESSES < calls.json

This process imports the modules of one generator, then divides the calls among copies of itself. Calls that fail are
skipped: FuseSoC's own call then generates the core or reports the faults.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import subprocess
import sys
from collections.abc import Generator as Steps
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

import yaml
from fusesoc.utils import YamlDumper

from fusesoc_firm.builds.call.answer import Basis, fulfil
from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS, MESSAGES
from fusesoc_firm.core.request import GeneratorCall, Request
from fusesoc_firm.text.diagnostics import InputError, SourceRef, fail
from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.facts import facts

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
        if count := min(jobs, len(mine) // _LEAST):
            yield from _run(generator, mine, count)


def _run(generator: str, calls: list[GeneratorCall], count: int) -> Steps[None, None, None]:
    steps, end = os.pipe()
    # All copies are in the process group, so that all can be ended together.
    process = subprocess.Popen(
        [sys.executable, "-m", __name__, generator, str(count)],
        stdin=subprocess.PIPE,
        stdout=end,
        stderr=subprocess.DEVNULL,
        text=True,
        process_group=0,
    )
    os.close(end)
    try:
        assert process.stdin
        with process.stdin, suppress(BrokenPipeError):
            json.dump([vars(call) for call in calls], process.stdin, default=str)
        _load(calls[0])
        while done := os.read(steps, 100):
            yield from [None] * len(done)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        # The pipe ends when the last copy has ended.
        while os.read(steps, 100):
            pass
        os.close(steps)
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
    name, count = sys.argv[1:]
    generator = GENERATORS[name]
    # All calls use the modules that the first call imported, so results are not stored if a module was edited since
    # then.
    code = facts("code", [""])
    calls = [GeneratorCall(**item) for item in json.load(sys.stdin)]
    own_code.watch()

    def process(call: GeneratorCall) -> None:
        with suppress(InputError):
            fulfil(_request(call), generator, Basis("", [*code]), _file_of(call))
        os.write(sys.stdout.fileno(), b".")

    process(calls[0])
    share, copies = _copied(int(count))
    for call in calls[1 + share :: int(count)]:
        process(call)
    for copy in copies:
        os.waitpid(copy, 0)


def _copied(count: int) -> tuple[int, list[int]]:
    """Return, in each of `count` copies of this process, its number from 0, and the copies that it has to wait for."""
    # The garbage collector would write to each object, and so copy its page.
    gc.freeze()
    copies: list[int] = []
    for number in range(1, count):
        if (copy := os.fork()) == 0:
            return number, []
        copies.append(copy)
    return 0, copies


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
