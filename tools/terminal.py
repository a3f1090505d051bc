"""The pictures of a terminal and of a waveform in the documentation: a new project, and its first simulation.

    python -m tools.terminal docs/pictures

Writes `terminal.svg` and `waves.svg`. Both come from a real run and contain neither dates nor paths of the machine.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

BIN = Path(sys.executable).parent
COMMANDS = (
    "firm init turn --in geometry_msgs/Point --out geometry_msgs/Vector3 --width 64",
    "firm sim turn/turn.yaml --options=--vcd=waves.vcd",
)
# The option for the waveform does not belong to the picture.
HIDDEN = " --options=--vcd=waves.vcd"
SCOPE = "u_system"
# The signals of the waveform, in the order of the data flow.
SIGNALS = (
    "clk",
    "s_axis_tvalid",
    "s_axis_tready",
    "s_axis_tdata",
    "sub_msg_valid",
    "sub_msg_ready",
    "sub_x",
    "pub_segment_valid",
    "pub_msg_ready",
    "m_axis_tvalid",
    "m_axis_tready",
    "m_axis_tdata",
)
CYCLES = 30
FONT = "font-family='ui-monospace, Menlo, Consolas, monospace' font-size='13'"
# Of a letter, in pixels; `textLength` makes it so in every font.
LETTER, LINE = 7.8, 18
ROW, CYCLE, LABEL = 26, 26, 150


def main(folder: Path) -> None:
    """Run the commands in a folder of their own, and write both pictures."""
    with tempfile.TemporaryDirectory() as name:
        lines = [line for command in COMMANDS for line in shown(command, Path(name))]
        (folder / "terminal.svg").write_text(terminal(lines), encoding="utf-8")
        (found,) = Path(name).rglob("waves.vcd")
        (folder / "waves.svg").write_text(waves(read(found)), encoding="utf-8")


def shown(command: str, folder: Path) -> Iterator[str]:
    """The prompt with a command, and the lines that it prints."""
    environment = os.environ | {"PATH": f"{BIN}:{os.environ['PATH']}", "COLUMNS": "100"}
    done = subprocess.run(command.split(), cwd=folder, env=environment, capture_output=True, text=True, check=True)
    yield f"$ {command.removesuffix(HIDDEN)}"
    yield from done.stdout.splitlines()
    yield ""


def terminal(lines: Sequence[str]) -> str:
    """The picture of a terminal with these lines; prompts and the verdict are coloured."""
    columns = max(map(len, lines))
    width, height = round(columns * LETTER) + 32, len(lines) * LINE + 24
    texts = [
        f"<text x='16' y='{28 + number * LINE}' fill='{_colour(line)}' xml:space='preserve' "
        f"textLength='{len(line) * LETTER:.1f}'>{escape(line)}</text>"
        for number, line in enumerate(lines)
        if line
    ]
    return _svg(width, height, [f"<rect width='{width}' height='{height}' rx='8' fill='#1b1f24'/>", *texts])


def _colour(line: str) -> str:
    return "#7ee787" if line.startswith("PASS") else "#79c0ff" if line.startswith("$") else "#e6edf3"


def _svg(width: int, height: int, parts: Sequence[str]) -> str:
    head = f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' "
    return "\n".join([f"{head}viewBox='0 0 {width} {height}' {FONT}>", *parts, "</svg>", ""])


@dataclass
class Wave:
    """A signal: its bits, and its value before each rising edge of the clock."""

    bits: int
    values: list[str] = field(default_factory=list)


def read(path: Path) -> dict[str, Wave]:
    """The signals of `SIGNALS` in a VCD file, sampled before each rising edge of clk."""
    lines = iter(path.read_text(encoding="ascii").splitlines())
    codes = {code: name for name, code in _declared(lines).items()}
    found = {name: Wave(bits) for (name, bits) in codes.values()}
    now = dict.fromkeys(found, "")
    for line in lines:
        value, code = line[1:].split() if line.startswith("b") else (line[:1], line[1:])
        if code not in codes:
            continue
        name, _ = codes[code]
        if name == "clk" and value == "1":
            for other, wave in found.items():
                wave.values.append(now[other])
        now[name] = value
    return found


def _declared(lines: Iterator[str]) -> Mapping[tuple[str, int], str]:
    """The codes of the signals in the system's scope, by name and bits; reads to the end of the declarations."""
    scopes: list[str] = []
    found: dict[tuple[str, int], str] = {}
    for line in lines:
        match line.split():
            case ["$scope", _, name, _]:
                scopes.append(name)
            case ["$upscope", *_]:
                scopes.pop()
            case ["$var", _, bits, code, name, *_] if scopes[-1] == SCOPE and name.partition("[")[0] in SIGNALS:
                found[name.partition("[")[0], int(bits)] = code
            case ["$enddefinitions", *_]:
                break
    return found


def waves(signals: Mapping[str, Wave]) -> str:
    """The picture of the signals from the first beat on."""
    first = signals["s_axis_tvalid"].values.index("1") - 1
    rows = [(name, signals[name]) for name in SIGNALS if name in signals]
    width, height = LABEL + CYCLES * CYCLE + 16, len(rows) * ROW + 16
    parts = [f"<rect width='{width}' height='{height}' rx='8' fill='#ffffff'/>"]
    for number, (name, wave) in enumerate(rows):
        low = 8 + (number + 1) * ROW - 6
        parts.append(f"<text x='{LABEL - 10}' y='{low - 4}' text-anchor='end' fill='#24292f'>{name}</text>")
        values = wave.values[first : first + CYCLES]
        if name == "clk":
            parts.append(_line(_clock(low), "#8c959f"))
        elif wave.bits == 1:
            parts.append(_line(_levels(values, low), "#0969da"))
        else:
            parts += _buses(values, low)
    return _svg(width, height, parts)


def _line(points: Sequence[tuple[float, float]], colour: str) -> str:
    path = " ".join(f"{x:g},{y:g}" for x, y in points)
    return f"<polyline points='{path}' fill='none' stroke='{colour}' stroke-width='1.5'/>"


def _clock(low: float) -> list[tuple[float, float]]:
    high, half = low - 16, CYCLE / 2
    starts = [LABEL + cycle * CYCLE for cycle in range(CYCLES)]
    return [point for x in starts for point in ((x, low), (x, high), (x + half, high), (x + half, low))]


def _levels(values: Sequence[str], low: float) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = []
    for cycle, value in enumerate(values):
        y, x = low - 16 if value == "1" else low, LABEL + cycle * CYCLE
        points += [(x, y), (x + CYCLE, y)]
    return points


def _buses(values: Sequence[str], low: float) -> Iterator[str]:
    """A box for each value of a vector, with as much of its hexadecimal text as fits."""
    start = 0
    for cycle in range(1, len(values) + 1):
        if cycle == len(values) or values[cycle] != values[start]:
            x, size = LABEL + start * CYCLE, (cycle - start) * CYCLE
            yield f"<rect x='{x}' y='{low - 16}' width='{size}' height='16' fill='#ddf4ff' stroke='#0969da'/>"
            text = _text(values[start], int((size - 6) // LETTER))
            yield f"<text x='{x + size / 2:g}' y='{low - 4}' text-anchor='middle' fill='#24292f'>{text}</text>"
            start = cycle


def _text(value: str, letters: int) -> str:
    if set(value) - {"0", "1"} or not value:
        return ""
    digits = f"{int(value, 2):x}"
    return digits if len(digits) <= letters else f"{digits[: letters - 1]}…" if letters > 1 else ""


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="tools.terminal", description="Draw a terminal and a waveform.")
    parser.add_argument("folder", type=Path, help="the folder of the pictures, such as docs/pictures")
    main(parser.parse_args().folder)
