"""Run one step of a build, as FuseSoC does after its setup, in the build's folder.

    python -m fusesoc_firm.builds.step.backend build|run flow|tool NAME EDAM

Each step is a separate process, so that all its accesses can be observed. NAME is the flow or the tool, and EDAM is
Edalize's description of the build, which FuseSoC's setup wrote. The run of a simulation fails unless its bench passed.
"""

from __future__ import annotations

import os
import subprocess
import sys
from copy import deepcopy
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.step.bench import bench_of
from fusesoc_firm.builds.step.flow import backend, resolved
from fusesoc_firm.builds.step.output import each_line


def main(arguments: list[str]) -> int:
    """Run the step; return the exit status."""
    step, api, name, edam = arguments
    try:
        build = resolved(api, name, _read(edam), ".")
        if step == "build":
            _backend(*build).build()
        elif fault := _run(*build):
            print(f"error: not passed: {fault}", flush=True)
            return 1
    except RuntimeError as error:
        print(f"ERROR: Failed to {step} {Path(edam).name.removesuffix('.eda.yml')} : {error}", flush=True)
        return 1
    return 0


def _run(api: str, name: str, edam: dict[str, Any]) -> str:
    """Run a build; return why its bench has not passed, or an empty text. May raise `RuntimeError`."""
    bench = bench_of(api, name, edam)
    if not bench.has_run:
        return ""
    configured = deepcopy(edam)
    bench.prepare()
    made = _backend(api, name, edam)
    if edam != configured:
        made.configure()
    with each_line(bench.see):
        # Of Edalize's flows, that of Verilator runs neither of the two hooks, and the others only the first.
        if api == "flow" and edam["flow_options"].get("tool") == "verilator":
            _run_hook("pre_run", edam)
        made.run()
        if api == "flow":
            _run_hook("post_run", edam)
    return bench.verdict()


def _run_hook(name: str, edam: dict[str, Any]) -> None:
    """Run the scripts of a hook. May raise `RuntimeError`."""
    for script in edam.get("hooks", {}).get(name, ()):
        done = subprocess.run(script["cmd"], env={**os.environ, **script.get("env", {})}, check=False)
        if done.returncode:
            raise RuntimeError(f"the script '{script['name']}' of {name} exited with status {done.returncode}")


def _read(edam: str) -> Any:
    from fusesoc_firm.text.yaml_text import data_in

    return data_in(Path(edam))


def _backend(api: str, name: str, edam: dict[str, Any]) -> Any:
    return backend(api, name, edam, str(Path.cwd()))


if __name__ == "__main__":
    # Edalize reports programs with its logger, and prints between their output.
    import logging

    logging.basicConfig(level=logging.INFO, format="%(levelname)s: %(message)s")
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    sys.exit(main(sys.argv[1:]))
