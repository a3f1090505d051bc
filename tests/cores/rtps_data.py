"""The files of `firm_rtps_node_tb`: memories of a node, and events.

tools/rtps_data.py writes those of the core's target `sim_node`.
"""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.fabric.control import generics_of, words_of
from fusesoc_firm.fabric.names import names
from fusesoc_firm.fabric.packets import programs_of
from tests.cores.announcements import ROOM, Peers, a_node
from tests.hdl.ghdl import CORES, Generic

DATA = CORES / "net" / "tb" / "data"
NODE = a_node()
SEED, TURNS = 20261127, 15
SIZES: dict[str, Generic] = {
    **generics_of(NODE, ROOM),
    "DEPTH": 4096,
    "SAMPLES": 16,
}


def write_memories(folder: Path, prefix: str = "") -> None:
    """The memories, a word in each row."""
    programs = programs_of(NODE)
    rows = {
        "names": [word.hex() for word in names(NODE.compared)],
        "program": [f"{word:09x}" for word in words_of(NODE, ROOM)],
        "packets": [f"{word:03x}" for word in programs.words],
        "entries": list(map(str, programs.entries.values())),
    }
    for name, texts in rows.items():
        (folder / f"{prefix}{name}.txt").write_text("".join(f"{text}\n" for text in texts), encoding="ascii")


def write_data(folder: Path) -> None:
    """The memories and the events of the core's target."""
    write_memories(folder, "node_")
    peers = Peers(2, SEED)
    peers.succession()
    events = peers.run(TURNS)
    (folder / "node_events.txt").write_text("".join(event.row for event in events), encoding="ascii")
