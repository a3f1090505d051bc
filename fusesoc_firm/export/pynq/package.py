"""The package of a system's overlay for PYNQ: the driver's class, the definitions of its messages, a notebook.

The bitstream and the description of the hardware (`.hwh`) come from a build with Vivado; PYNQ finds the description by
the bitstream's name.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

from fusesoc_firm import __version__
from fusesoc_firm.message.printer import to_text
from fusesoc_firm.node.interface.description import NodeDescription, describe
from fusesoc_firm.system.boards.board import Board, board_entity, check_fits
from fusesoc_firm.system.boards.overlay import check_runs_linux
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.render import Context, render

# Where Vivado writes the files, below the folder of its project; releases before 2020.2 have `.srcs` instead of `.gen`.
_BITSTREAM = "*.runs/impl_1/{}_wrapper.bit"
_DESCRIPTIONS = ("*.gen/sources_1/bd/{0}/hw_handoff/{0}.hwh", "*.srcs/sources_1/bd/{0}/hw_handoff/{0}.hwh")
_NOTEBOOK_FORMAT = {"nbformat": 4, "nbformat_minor": 5}
_KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def overlay_name(loaded: LoadedSystem, board: Board) -> str:
    """Return the name of the package, of the `.bit` file and of the `.hwh` file."""
    return board_entity(loaded.system, board)


def overlay_files(loaded: LoadedSystem, board: Board) -> Mapping[str, str]:
    """Return the files of the package by path.

    Raise `InputError` if the board has no processor, if the system does not fit on it, or if it is not carried by
    topics alone.
    """
    check_runs_linux(board)
    check_fits(loaded.system, board)
    description = describe(loaded)
    _check_topics(loaded, description)
    context = _context(loaded, board, description)
    name = overlay_name(loaded, board)
    return {
        "README.md": render("pynq/README.md", context),
        "pyproject.toml": render("pynq/pyproject.toml", context),
        f"{name}/__init__.py": render("pynq/driver.py", context),
        f"{name}/notebooks/{name}.ipynb": _notebook(context),
        **{f"{name}/messages/{path}": text for path, text in _definitions(loaded)},
    }


def built_files(build: Path, name: str) -> Mapping[str, Path]:
    """Return the bitstream and the description of the hardware in the folder of a build, by path in the package.

    Raise `InputError` if one of them is missing.
    """
    found: dict[str, Path] = {}
    for ending, patterns in ((".bit", (_BITSTREAM,)), (".hwh", _DESCRIPTIONS)):
        places = [pattern.format(name) for pattern in patterns]
        path = next((path for place in places for path in sorted(build.glob(place))), None)
        if path is None:
            fail(f"{build} has no {name}{ending}", hint=f"Vivado writes it as {' or '.join(places)}")
        found[f"{name}/{name}{ending}"] = path
    return found


def _check_topics(loaded: LoadedSystem, description: NodeDescription) -> None:
    system = loaded.system
    others = [item.block for item in system.services] + [item.block for item in system.actions]
    others += [item.block for item in system.software.blocks]
    if others:
        fail(
            f"'{others[0]}' is a service, an action or software; an overlay's driver carries topics only",
            hint="a node carries all of them: firm system node",
        )
    if not description.publishers or not description.subscribers:
        fail(f"system '{description.name}' has no subscribers or no publishers")


def _context(loaded: LoadedSystem, board: Board, description: NodeDescription) -> Context:
    name = overlay_name(loaded, board)
    return {
        "name": name,
        "bitstream": f"{name}.bit",
        "distribution": name.replace("_", "-"),
        "class": _class_name(description.name),
        "system": description.name,
        "board": board.name,
        "version": __version__,
        "width": description.width,
        "longest": repr(description.longest_payload),
        "is_preemptive": repr(loaded.system.scheduling.is_preemptive),
        "subscribers": [*map(_topic, loaded.system.subscribers)],
        "publishers": [*map(_topic, loaded.system.publishers)],
        "first": str(loaded.system.subscribers[0].block),
    }


def _class_name(system: str) -> str:
    """Return the name of the driver's class, such as `JointPidOverlay` for `joint_pid`."""
    return f"{''.join(word[:1].upper() + word[1:] for word in system.split('_'))}Overlay"


def _topic(topic: Converter) -> Context:
    return {
        "block": str(topic.block),
        "id": topic.id,
        "message": str(topic.frame.message),
        "ros": topic.frame.ros.number,
        "title": topic.frame.ros.title,
    }


def _definitions(loaded: LoadedSystem) -> Iterator[tuple[str, str]]:
    """Yield the definition of each message, by path in the folder of definitions."""
    for topic in dict.fromkeys((*loaded.system.subscribers, *loaded.system.publishers)):
        ros = topic.frame.ros
        for name, definition in loaded.libraries[ros].closure(topic.frame.message).items():
            yield f"ros{ros.number}/{name.package}/msg/{name.name}.msg", to_text(definition)


def _notebook(context: Context) -> str:
    """Return a notebook, whose cells are the parts of its template."""
    _, *parts = render("pynq/notebook.py", context).split("\n# %%")
    cells = [_cell(f"cell-{number}", part) for number, part in enumerate(parts)]
    return json.dumps({"cells": cells, "metadata": {"kernelspec": _KERNEL}, **_NOTEBOOK_FORMAT}, indent=1) + "\n"


def _cell(identifier: str, part: str) -> dict[str, object]:
    """Return a cell; those of text are comments, after the word for them."""
    kind, _, text = part.partition("\n")
    cell = {"id": identifier, "metadata": {}}
    if kind:
        lines = [line.removeprefix("#").removeprefix(" ") for line in text.strip().splitlines()]
        return {"cell_type": "markdown", **cell, "source": "\n".join(lines)}
    return {"cell_type": "code", **cell, "source": text.strip(), "execution_count": None, "outputs": []}
