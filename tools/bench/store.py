"""The work of a second run of FuseSoC, and its cost in addition to FuseSoC itself."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import yaml

from fusesoc_firm.tools.own_code import PACKAGE
from tests.hdl.ghdl import REPOSITORY
from tests.processes import program
from tools.bench.systems import processor_time
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell

RUN_TITLE = "A second run of the applications' target `sim`"
EDIT_TITLE = "An edit in a project of 60 messages"
APPLICATIONS = ("image_pipeline", "mobile_robot", "multi_type", "obstacle", "quat2euler", "robotic_arm", "sobel")
RUNS = 7
BAR = 0.3

_RUN_COLUMNS = (
    *("application", "first run, s", "FuseSoC itself, s", "second run, s"),
    *("beyond, wall, s", "beyond, processor, s", "bar, s", "result"),
)
_RUN_NOTE = f"""
    The command is `fusesoc run --setup`. 'FuseSoC itself' is the set-up of a core with the same files, which are in a
    library and not generated. The first run starts with an empty store. In the second run, all calls are hits, and
    nothing is generated. Times are medians of {RUNS} runs, which alternate between FuseSoC itself and the second run;
    'beyond' is the median of their differences. The bar applies to the processor time, which equals the wall-clock time
    on an idle machine.
    """
_EDIT_COLUMNS = ("edited", "depend on it", "generated", "from the store", "as expected")
_EDIT_NOTE = """
    A core calls the generator `firm` once for each message: 24 of fixed size; 18 of fixed size that contain another
    message, Base; 18 of variable size, 6 of which contain Base. On every run, FuseSoC calls the generator for each
    message; unaffected calls are hits. All messages depend on this package's modules and templates. 'as expected' is
    met under three conditions: only the cores that depend on the edited file are generated; the text changes only in
    the cores that use the edited part; after the edit is undone, all calls are hits.
    """
CORE = "bench:store:all:1"


@dataclass(frozen=True)
class Edit:
    """An edit of a file, ours or the user's, and the kinds of messages that depend on it.

    `shown` are those of which the text is another one then, all that depend on it unless it says otherwise.
    """

    name: str
    file: str
    before: str
    after: str
    kinds: frozenset[str]
    shown: frozenset[str] | None = None


# Kinds of messages, each with its share of all and its definition.
FLAT, NESTED, TEXT, NESTED_TEXT = "Flat", "Nested", "Text", "NestedText"
_KINDS = {
    FLAT: (24, "uint16 a\nfloat64 b\n"),
    NESTED: (18, "Base base\nuint8 a\n"),
    TEXT: (12, "string text\nuint8 a\n"),
    NESTED_TEXT: (6, "Base base\nstring text\n"),
}
EDITS = (
    Edit("the message Base", "msgs/msg/Base.msg", "uint8", "uint32", frozenset({NESTED, NESTED_TEXT})),
    Edit("the core's description", "msgs/all.core", "filesets:", "# edited\nfilesets:", frozenset()),
    Edit(
        "the partial store_beats.mustache",
        "code/fusesoc_firm/templates/partials/store_beats.mustache",
        "if store{{{suffix}}} = '1' then\n",
        "if store{{{suffix}}} = '1' then -- edited\n",
        frozenset(_KINDS),
        frozenset({FLAT, NESTED}),
    ),
    Edit(
        "the module naming.py",
        "code/fusesoc_firm/text/naming.py",
        '"""\n',
        '"""\n# edited\n',
        frozenset(_KINDS),
        frozenset(),
    ),
)


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {RUN_TITLE: [(name,) for name in APPLICATIONS], EDIT_TITLE: [(edit.name,) for edit in EDITS]}


def measure(tell: Tell) -> list[Table]:
    """Run all; `tell` hears of each."""
    return [
        Table(RUN_TITLE, _RUN_COLUMNS, tuple(_told(map(_run_row, APPLICATIONS), tell)), _RUN_NOTE),
        Table(EDIT_TITLE, _EDIT_COLUMNS, tuple(_told(edit_rows(), tell)), _EDIT_NOTE),
    ]


def _told(rows: Iterator[tuple[str, ...]], tell: Tell) -> Iterator[tuple[str, ...]]:
    for row in rows:
        tell(" ".join(row))
        yield row


def set_up(
    folder: Path, core: str, libraries: Sequence[Path], target: str = "default", code: Path = REPOSITORY
) -> dict[str, str]:
    """Let FuseSoC set up a core: where each generated one came from, "generated" or "from" the store.

    Raises `CalledProcessError`.
    """
    configuration = folder / "fusesoc.conf"
    configuration.write_text("".join(f"[library.l{n}]\nlocation = {path}\n" for n, path in enumerate(libraries)))
    done = subprocess.run(
        [
            program("fusesoc"),
            *("--config", str(configuration), "run", "--setup", f"--target={target}"),
            *("--build-root", str(folder / "build"), core),
        ],
        cwd=folder,
        env=os.environ
        | {
            "FUSESOC_FIRM_CACHE": str(folder / "store"),
            "PYTHONPATH": str(code),
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
            "HOME": str(folder),
        },
        check=True,
        capture_output=True,
        text=True,
    )
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith(("far: ", "firm: "))]
    return {words[1]: words[2] for words in lines}


def _run_row(name: str) -> tuple[str, ...]:
    with tempfile.TemporaryDirectory() as place:
        with_generators, plain = Path(place, "generators"), Path(place, "plain")
        with_generators.mkdir()
        library = [REPOSITORY / "cores", REPOSITORY / "generators"]
        core = f"robot:sys:{name}"
        start = time.monotonic()
        set_up(with_generators, core, [REPOSITORY / "specs", *library], "sim")
        first = time.monotonic() - start
        _write_plain(name, with_generators / "build", plain)
        itself, second = [], []
        for _ in range(RUNS):
            before = _clocks()
            assert not set_up(plain, core, [plain / "library", *library], "sim")
            middle = _clocks()
            origins = set_up(with_generators, core, [REPOSITORY / "specs" / name, *library], "sim")
            itself.append(middle - before)
            second.append(_clocks() - middle)
            if len(origins) != 2 or set(origins.values()) != {"from"}:
                return (name, *[""] * 5, f"{BAR:g}", FAILED)
    wall, processor = np.median(np.array(second) - itself, axis=0)
    seconds = (first, np.median(itself, axis=0)[0], np.median(second, axis=0)[0], wall, processor)
    return (name, *(f"{value:.2f}" for value in seconds), f"{BAR:g}", MET if processor <= BAR else MISSED)


def _clocks() -> npt.NDArray[np.float64]:
    """Seconds of the wall clock, and those of the processor in processes that have ended."""
    return np.array([time.monotonic(), processor_time()])


def _write_plain(name: str, build: Path, folder: Path) -> None:
    """A library with the core, and with what was generated for it as cores that it depends on."""
    library = folder / "library"
    library.mkdir(parents=True)
    (generated,) = build.rglob("generator_cache")
    names = []
    for path in generated.glob("*/*.core"):
        shutil.copytree(path.parent, library / path.parent.name)
        names.append(str(_read_core(path)["name"]))
    core = _read_core(REPOSITORY / "specs" / name / f"{name}.core")
    del core["generate"]
    target = {key: value for key, value in core["targets"]["sim"].items() if key not in ("generate", "<<")}
    filesets = {**core["filesets"], "generated": {"depend": sorted(names)}}
    plain = {**core, "filesets": filesets, "targets": {"sim": {**target, "filesets": [*filesets]}}}
    (library / f"{name}.core").write_text("CAPI=2:\n" + yaml.safe_dump(plain, sort_keys=False))


def _read_core(path: Path) -> dict[str, dict[str, dict[str, object]]]:
    read: dict[str, dict[str, dict[str, object]]] = yaml.safe_load(path.read_text().removeprefix("CAPI=2:"))
    return read


def edit_rows(share: int = 1) -> Iterator[tuple[str, ...]]:
    """The rows of the second table, for one of `share` messages."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        names = write_project(folder, share)

        def origins() -> dict[str, str]:
            code, libraries = folder / "code", [folder / "msgs", folder / "code/generators", REPOSITORY / "cores"]
            found = set_up(folder, CORE, libraries, code=code)
            return {name: found[f"all-{name.lower()}"] for name in names}

        assert set(origins().values()) == {"generated"}
        for edit in EDITS:
            path = folder / edit.file
            text, before = path.read_text(), _converters(folder)
            assert edit.before in text, f"{edit.file} has no {edit.before!r}"
            path.write_text(text.replace(edit.before, edit.after, 1))
            found, after = origins(), _converters(folder)
            path.write_text(text)
            again = set(origins().values())
            made = {name for name in names if found[name] == "generated"}
            expected = {name for name, kind in names.items() if kind in edit.kinds}
            changed = {name for name in names if before[name.lower()] != after[name.lower()]}
            shown = {name for name, kind in names.items() if kind in (edit.kinds if edit.shown is None else edit.shown)}
            is_good = made == expected and changed == shown and again == {"from"} and _converters(folder) == before
            counts = (len(expected), len(made), len(names) - len(made))
            yield (edit.name, *map(str, counts), MET if is_good else MISSED)


def write_project(folder: Path, share: int) -> dict[str, str]:
    """A copy of our code, messages, and a core that calls a generator for each: their kinds by name."""
    left_out = shutil.ignore_patterns("demos", "library", "__pycache__")
    shutil.copytree(PACKAGE, folder / "code" / "fusesoc_firm", ignore=left_out)
    shutil.copytree(REPOSITORY / "generators", folder / "code" / "generators", ignore=left_out)
    messages = folder / "msgs" / "msg"
    messages.mkdir(parents=True)
    (messages / "Base.msg").write_text("uint8 value\n")
    names = {f"{kind}{number}": kind for kind, (count, _) in _KINDS.items() for number in range(count // share)}
    for name, kind in names.items():
        (messages / f"{name}.msg").write_text(_KINDS[kind][1])
    (folder / "msgs" / "package.xml").write_text("<package><name>my_msgs</name></package>\n")
    calls = {
        name.lower(): {"generator": "firm", "parameters": {"message": f"my_msgs/{name}", "ros": 2, "paths": ["."]}}
        for name in names
    }
    core = {
        "name": CORE,
        "filesets": {"base": {"depend": ["robot:firm:generators"]}},
        "generate": calls,
        "targets": {
            "default": {
                "filesets": ["base"],
                "generate": [*calls],
                "toplevel": "none",
                "flow": "generic",
                "flow_options": {"tool": "yosys", "arch": "ice40"},
            }
        },
    }
    (folder / "msgs" / "all.core").write_text("CAPI=2:\n" + yaml.safe_dump(core, sort_keys=False))
    return names


def _converters(folder: Path) -> dict[str, str]:
    """The text of all that was generated of each message, by its name in small letters."""
    found: dict[str, str] = {}
    for path in sorted((folder / "build").rglob("generator_cache/*/*.vhd")):
        name = path.parent.name.partition("all-")[2].partition("_1")[0]
        found[name] = found.get(name, "") + path.read_text()
    return found
