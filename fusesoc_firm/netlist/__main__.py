"""`python -m fusesoc_firm.netlist FILE`: run the translation in a file that `Translation.to_json` wrote."""

from __future__ import annotations

import sys
from pathlib import Path

from fusesoc_firm.netlist.model import NetlistError
from fusesoc_firm.netlist.translation import Translation, translate
from fusesoc_firm.tools.manifest import note


def main(path: Path) -> int:
    """Run the translation and return the exit status; without a netlist, print the reason and return 1."""
    translation = Translation.from_json(path.read_text(encoding="utf-8"))
    try:
        warnings = translate(translation, path.with_suffix(".ghdl"))
    except NetlistError as error:
        print(f"ghdlsynth: {translation.top}: no Verilog netlist\n{error}", file=sys.stderr)
        return 1
    note("ghdl", Path())
    if warnings:
        print(warnings, file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
