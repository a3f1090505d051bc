"""Writes the data of the core's target `sim_node` in cores/net: memories of a node, and events.

    python -m tools.rtps_data

What the node does then is in `node_results.txt`, of which the bench makes a new one, `results.txt`.
"""

from __future__ import annotations

import argparse

from fusesoc_firm.fabric.control import main_of
from tests.cores.rtps_data import DATA, NODE, write_data

if __name__ == "__main__":
    argparse.ArgumentParser(prog="tools.rtps_data", description="Write the data of a node's simulation.").parse_args()
    write_data(DATA)
    print(f"the program's loop is at {main_of(NODE)}")
