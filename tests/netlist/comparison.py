"""Whether the netlists of designs do what their VHDL does, many in one build, and which of them do not."""

from __future__ import annotations

import re
import shutil
import tempfile
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

from fusesoc_firm.netlist.model import NetlistError
from tests.netlist import simulators
from tests.netlist.designs import Design, design
from tests.netlist.simulators import RESETS, ToolError

INPUTS = 50


DIFFERENCE = "differ"
# No netlist: GHDL crashes, or reports an error; or the translation says what GHDL would make wrong.
CRASH, REFUSAL = "crash GHDL", "are refused"
# A simulator or Yosys does not take its input.
FAILURE = "fail in a simulator"


@dataclass(frozen=True)
class Difference:
    """A design whose netlist is wrong, or that has none, and who says so: a judge, or `translation`, or `tool`."""

    design: Design
    judge: str
    kind: str
    message: str

    def __str__(self) -> str:
        return f"{self.judge}, seed {self.design.seed}, {self.kind}: {self.message}\n\n{self.design.text}"


def designs(seed: int, first: int, number: int) -> list[Design]:
    """The designs of a seed, counted from `first`."""
    return [design(f"d{index}", f"{seed}.{index}") for index in range(first, first + number)]


def differences(batch: Sequence[Design], judges: Sequence[str]) -> list[Difference]:
    """What is wrong with a batch. What a program refuses is taken out, and the rest is compared without it."""
    if not batch:
        return []
    folder = Path(tempfile.mkdtemp(prefix="netlist_"))
    try:
        return list(_compared(batch, judges, folder))
    except (ToolError, NetlistError) as error:
        refused = _named(str(error), batch)
        if refused or len(batch) == 1:
            who, kind = _refusal(error)
            found = [Difference(item, who, kind, str(error)) for item in refused or batch]
            return [*found, *differences([item for item in batch if item not in refused and refused], judges)]
        half = len(batch) // 2
        return [*differences(batch[:half], judges), *differences(batch[half:], judges)]
    finally:
        shutil.rmtree(folder)


def _refusal(error: Exception) -> tuple[str, str]:
    if isinstance(error, ToolError):
        return "tool", FAILURE
    return "translation", CRASH if "GHDL crashed" in str(error) else REFUSAL


def _named(message: str, batch: Sequence[Design]) -> list[Design]:
    """The designs of a batch in whose lines an error is."""
    ends = list(accumulate(item.text.count("\n") for item in batch))
    lines = {
        int(line)
        for line in re.findall(rf"^\S*{simulators.TOP}\.vhd:(\d+):(?!.*was not analysed)", message, re.MULTILINE)
    }
    places = {bisect_left(ends, line) for line in lines}
    return [batch[place] for place in sorted(places) if place < len(batch)]


def _compared(batch: Sequence[Design], judges: Sequence[str], folder: Path) -> Iterator[Difference]:
    # The same for all designs of a seed, so that one alone behaves as in its batch.
    inputs = simulators.stimuli(batch[0].seed.partition(".")[0], INPUTS)
    simulators.write(batch, inputs, folder)
    expected = [simulators.words(line) for line in simulators.ghdl(folder).splitlines()]
    assert len(expected) == 2 * INPUTS, expected
    simulators.netlist(folder)
    for judge in judges:
        found = [simulators.words(line) for line in simulators.JUDGES[judge](folder).splitlines() if _is_result(line)]
        if len(found) != len(expected):
            raise ToolError(f"{judge}: {len(found)} lines instead of {len(expected)}")
        for number, item in enumerate(batch):
            for line in range(2 * RESETS, len(expected)):
                right, got = expected[line][number], found[line][number]
                if _differ(right, got):
                    when = f"{inputs[line // 2]:032x}, {'after' if line % 2 else 'before'} the edge"
                    yield Difference(
                        item,
                        judge,
                        DIFFERENCE,
                        f"with input {line // 2}, {when}: {right} in GHDL, {got} in {judge}",
                    )
                    break


def _is_result(line: str) -> bool:
    return bool(line) and set(line.lower()) <= set("0123456789abcdefxz")


def _differ(right: str, got: str) -> bool:
    """Whether a digit differs that is defined in the VHDL."""
    return any(a not in {b, "x"} for a, b in zip(right, got, strict=True))
