#!/bin/sh
# Guess:    two builds with one of Edalize's flows in one process are independent: each has its own object and options.
# Really:   the options of the first build are merged into the class's table of tools. The second build, without
#           options, runs nextpnr with the first one's; and options that were given once are options that "the flow
#           sets", so the flow no longer offers them.
# Versions: Edalize 0.6.8
# Met by:   tools and tests that set up several boards or seeds in one Python process
# Instead:  a process for each build, or a subclass with a deep copy of `_flow` for each object
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install edalize==0.6.8

cat > two.py <<'PYTHON'
import os
from edalize.flows.trellis import Trellis

def build(folder, options):
    os.mkdir(folder)
    edam = {"name": "top", "toplevel": "top", "flow_options": options,
            "files": [{"name": "top.v", "file_type": "verilogSource"}]}
    Trellis(edam=edam, work_root=folder).configure()
    with open(f"{folder}/Makefile") as makefile:
        return next(line for line in makefile if "nextpnr-ecp5" in line)

print("offered before:", "nextpnr_options" in Trellis.get_tool_options({}))
print("first has --seed 7:", "--seed 7" in build("first", {"nextpnr_options": ["--seed", "7"]}))
print("second has --seed 7:", "--seed 7" in build("second", {}))
print("offered after:", "nextpnr_options" in Trellis.get_tool_options({}))
PYTHON
env/bin/pip list 2> /dev/null | grep -i '^edalize'
echo "guess: the second build has no --seed 7"
echo "seen:"
env/bin/python two.py > seen
cat seen
cat > expected <<'TEXT'
offered before: True
first has --seed 7: True
second has --seed 7: True
offered after: False
TEXT
cmp seen expected
