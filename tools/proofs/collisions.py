"""Netlists in which a read of a memory that meets a write of its address gives any word, and says so.

A memory is one that VHDL declares as `no_rw_check` (`firm_axis_pkg`). Both changes are derived from the memory's own
ports. All proofs are about such netlists, so what they prove holds whatever a colliding read gives; `collisions.sv`
proves that there is none.
"""

from __future__ import annotations

import re

_MODULE = re.compile(r"^module .*?^endmodule$", re.MULTILINE | re.DOTALL)
_MEMORY = re.compile(r'^  \(\* syn_ramstyle = "no_rw_check".*?\*\) reg (\[\d+:0\] )?(\w+)\[\d+:0\]', re.MULTILINE)
# As GHDL writes the ports of a memory: the condition, which may be missing, and the address. A port without a clock is
# before a register with a reset, which synthesis makes part of it.
_WRITE = r"^  always @\(posedge \w+\)\n(?:    if \((.*)\)\n)?\s+{}\[(.*)\] <= "
_READ = r"(^  (?:always @\(posedge \w+\)\n(?:    if \((.*)\)\n)?\s+\w+ <=|assign \w+ =) )({}\[(.*)\]);$"


def with_collisions(netlist: str) -> str:
    """Return GHDL's Verilog, in which each module with such memories has a wire `collides`."""
    return _MODULE.sub(_with_wire, netlist)


def _with_wire(module: re.Match[str]) -> str:
    text = module[0].removesuffix("endmodule")
    collisions: list[str] = []
    for word, memory in _MEMORY.findall(text):
        ((writes, written),) = re.findall(_WRITE.format(memory), text, re.MULTILINE)

        def freed(read: re.Match[str], word: str = word, writes: str = writes, written: str = written) -> str:
            number = len(collisions)
            collisions.append(f"({writes or 1} && {read[2] or 1} && {written} == {read[4]})")
            free = f"  (* anyseq *) wire {word}any_word_{number};\n"
            return f"{free}{read[1]}{collisions[-1]} ? any_word_{number} : {read[3]};"

        text = re.sub(_READ.format(memory), freed, text, flags=re.MULTILINE)
    wire = f"  wire collides = {' || '.join(collisions)};\n" if collisions else ""
    return f"{text}{wire}endmodule"
