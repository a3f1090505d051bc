"""Operations of the arithmetic, fed by `firm_sim_operation`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tests.hdl.ghdl import Generic, Library

CORES_OF_BENCHES = ("axis/package", "sim/checker", "sim/host", "sim/operation")


def operate(
    library: Library,
    bench: str,
    folder: Path,
    widths: Sequence[int],
    rows: Sequence[Sequence[int]],
    **generics: Generic,
) -> tuple[list[int], str]:
    """The results of a bench as bits, and its report; an operand has the width at its place, or the last one."""
    every = [*widths, *[widths[-1]] * max(map(len, rows))]
    lines = (
        "".join(format(number % 2**width, f"0{width}b") for number, width in zip(row, every, strict=False))
        for row in rows
    )
    (folder / "vectors.txt").write_text("\n".join(lines) + "\n")
    paths = {"VECTORS": str(folder / "vectors.txt"), "RESULTS": str(folder / "results.txt")}
    print(f"seed {generics['SEED']}")
    found = library.run(bench, {**paths, **generics})
    assert found.exit_code == 0, found.output
    return [int(line, 2) for line in (folder / "results.txt").read_text().split()], found.output
