"""`make policies`: writes the lists of policies in cores/sched, from fusesoc_firm/scheduling/policies.py."""

from __future__ import annotations

import argparse

from tests.hdl.ghdl import CORES
from tools.policies.lists import files

if __name__ == "__main__":
    argparse.ArgumentParser(prog="make policies", description=__doc__).parse_args()
    for file, content in files(CORES / "sched").items():
        file.write_text(content, encoding="ascii")
