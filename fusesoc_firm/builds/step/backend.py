"""Run one step of a build, as FuseSoC does after its setup, in the build's folder.

    python -m fusesoc_firm.builds.step.backend build|run flow|tool NAME EDAM

Each step is a separate process, so that all its accesses can be observed. NAME is the flow or the tool, and EDAM is
Edalize's description of the build, which FuseSoC's setup wrote.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def main(arguments: list[str]) -> int:
    """Run the step; return the exit status."""
    step, api, name, edam = arguments
    try:
        backend = _backend(api, name)(edam=_read(edam), work_root=str(Path.cwd()), verbose=False)
        backend.build() if step == "build" else backend.run()
    except RuntimeError as error:
        print(f"ERROR: Failed to {step} {Path(edam).name.removesuffix('.eda.yml')} : {error}", flush=True)
        return 1
    return 0


def _read(edam: str) -> Any:
    from fusesoc_firm.text.yaml_text import data_in

    return data_in(Path(edam))


def _backend(api: str, name: str) -> Any:
    if api == "flow":
        return getattr(import_module(f"edalize.flows.{name}"), name.capitalize())
    from edalize.edatool import get_edatool

    return get_edatool(name)


if __name__ == "__main__":
    # Edalize reports programs with its logger, and prints between their output.
    import logging

    logging.basicConfig(level=logging.INFO, format="%(levelname)s: %(message)s")
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    sys.exit(main(sys.argv[1:]))
