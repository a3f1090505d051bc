"""`firm init`: a new project in a separate folder, which passes its simulation at once.

The accelerator's first version copies the parts that both messages share; the model does the same.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.length import bounded_payload, longest_payload, sent_length_of
from fusesoc_firm.frame.model import Data, Frame, Loop
from fusesoc_firm.frame.select import select
from fusesoc_firm.message.library import Libraries
from fusesoc_firm.message.middleware import Middleware, middleware_of
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.scaffold.core_file import CoreOptions, new_core
from fusesoc_firm.system.scaffold.first_stimuli import first_stimuli
from fusesoc_firm.system.scaffold.pass_through import equal_paths, wires_of
from fusesoc_firm.system.scaffold.python_skeleton import copied_fields
from fusesoc_firm.system.scaffold.skeleton import missing_sources
from fusesoc_firm.system.scaffold.usual_sizes import Usual, usual_size
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from fusesoc_firm.system.written.specification import PYTHON, SOFTWARE
from fusesoc_firm.text.diagnostics import Diagnostic, InputError, fail, nearest
from fusesoc_firm.text.naming import KEYWORDS, identifier
from fusesoc_firm.text.outputs import check_parent, write
from fusesoc_firm.text.prompts import Asker, Question
from fusesoc_firm.text.render import Context, render
from fusesoc_firm.tools.library_path import LINK, link_library

_SUBSCRIBER, _PUBLISHER, _FORWARDER = "sub", "pub", "pass_through"
# The cores with the operations of accelerators, by language.
_ARITHMETIC = {"vhdl": "robot:acc:firm_float", "verilog": "robot:acc:firm_float", "python": "robot:acc:firm_python"}
_STIMULI = "stimuli.yaml"
# Bytes; block RAM of a small FPGA. The author of a specification chooses the size that the messages need.
_BUFFER = 4096
_IGNORED = ".firm/\nbuild/*\n!build/FUSESOC_IGNORE\n__pycache__/\n"


@dataclass(frozen=True)
class Language:
    """A language of accelerators: the type in specifications and the ending of a source's name."""

    type: str
    source: str


LANGUAGES = {
    "vhdl": Language("VHDL", "rtl/{}.vhd"),
    "verilog": Language("Verilog", "rtl/{}.v"),
    "hls": Language("HLS", "hls/{}.cpp"),
    "python": Language(PYTHON, "python/{}.py"),
    "software": Language(SOFTWARE, "software/{}.py"),
}


@dataclass(frozen=True)
class RecordedStimuli:
    """The stimuli of a new project from a bag: the name of the file and the bytes of the longest payload.

    `write` writes the file at a path. The file contains the definitions of all messages of the project.
    """

    name: str
    longest: int
    write: Callable[[Path], None]


@dataclass(frozen=True)
class Project:
    """The answers that determine a new project; `width` is in bits.

    An empty topic means the name of the block. Without `stimuli`, the project has generated examples. With `include`,
    the accelerator receives only these fields. If both messages are the same, it also sends only these fields, and the
    others pass. With `has_bench`, the project has a bench in cocotb.
    """

    name: str
    input: str
    output: str
    ros: int = 2
    language: str = "vhdl"
    width: int = 8
    input_topic: str = ""
    output_topic: str = ""
    stimuli: RecordedStimuli | None = None
    include: tuple[str, ...] = ()
    has_bench: bool = False


def name_fault(name: str) -> str | None:
    """Return the reason why a project cannot have this name, or None."""
    if name.lower() in KEYWORDS:
        return f"'{name}' is not legal: it is a keyword of VHDL or Verilog"
    if identifier(name) != name:
        return f"'{name}' is not legal; legal here: letters, digits and single '_' between them"
    if name.lower() in (_SUBSCRIBER, _PUBLISHER, _FORWARDER):
        return f"'{name}' is the name of another block of the new system"
    return None


def ask(
    known: Mapping[str, str],
    asker: Asker,
    names: Callable[[int], Sequence[str]],
    widths: Sequence[str],
    topics: Mapping[str, str] | None = None,
) -> Project:
    """Return a project from the known answers, and ask for missing answers.

    `names` returns the messages of a ROS version. `topics` are the topics of a bag, with their messages: the input is
    one of these topics; the output is a message or one of these topics. May raise `InputError`.
    """
    recorded = topics or {}

    def answer(name: str, meaning: str, words: Sequence[str] = (), default: str = "", **rules: Any) -> str:
        question = Question(name, meaning, words, default=default, is_required=True, **rules)
        return known[name] if name in known else asker.ask(question)

    name = answer("name", "the project's name, and the name of its folder and accelerator", check=name_fault)
    ros = int(answer("ros", "the ROS version of the messages", ("1", "2"), "2", is_choice=True))
    messages = names(ros)
    if recorded:
        taken = answer("in", "the topic in the bag that the accelerator receives", tuple(recorded), is_choice=True)
        given = answer("out", "the message or topic that the accelerator sends", [*recorded, *messages], is_choice=True)
        _check_topics(taken, given, recorded)
    else:
        taken = answer("in", "the message that the accelerator receives", messages, is_choice=True)
        given = answer("out", "the message that the accelerator sends", messages, is_choice=True)
    return Project(
        name,
        recorded.get(taken, taken),
        recorded.get(given, given),
        ros,
        answer("language", "the accelerator's language", tuple(LANGUAGES), "vhdl", is_choice=True),
        int(answer("width", "the width in bits of the streams", widths, "8", is_choice=True)),
        taken if taken in recorded else "",
        given if given in recorded else "",
    )


def _check_topics(taken: str, given: str, recorded: Mapping[str, str]) -> None:
    """Raise `InputError` for a topic that is missing from the bag, or would be both input and output."""
    for topic in (taken, given):
        if topic not in recorded and (topic is taken or topic.startswith("/")):
            fail(f"the bag has no topic '{topic}'", hint=nearest(topic, recorded))
    if taken == given:
        fail(f"'{taken}' is the topic of both the input and the output", hint="give the message of the output instead")


def create(project: Project, folder: Path, known: Libraries, paths: Sequence[Path] = ()) -> list[Path]:
    """Write a new project, and return its files, relative to `folder`.

    `paths` are further sources of message definitions. May raise `InputError`, such as for a folder that is not empty;
    nothing is written then.
    """
    if fault := name_fault(project.name):
        fail(fault)
    if project.include and LANGUAGES[project.language].type == SOFTWARE:
        hint = "omit --include, or choose vhdl, verilog, hls or python"
        fail("an accelerator in software receives whole messages, so it cannot have --include", hint=hint)
    if project.has_bench:
        _check_bench(project, paths)
    with new_folder(folder) as inner:
        _write_all(project, inner, known, [os.path.relpath(path, folder) for path in paths])
        write_surroundings(inner, project.name)
    return files_of(folder)


def _check_bench(project: Project, paths: Sequence[Path]) -> None:
    """Raise `InputError` for a project that a bench in cocotb cannot test."""
    if project.language not in ("vhdl", "verilog"):
        fail(f"cocotb cannot test an accelerator in {project.language}", hint="omit --bench, or choose vhdl or verilog")
    if project.stimuli or paths:
        hint = "omit --bench, or --from-bag and --path"
        fail("a bench in cocotb finds only messages of ROS and of the type stores, and stimuli in YAML", hint=hint)


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Return a folder to fill, which becomes `folder` if the context ends without an error.

    Raise `InputError` if `folder` is not empty. Faults in files that were written to the folder have no place, since
    the files no longer exist.
    """
    check_parent(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        fail(f"cannot write {folder}: it exists", hint="choose another name, or remove it")
    with tempfile.TemporaryDirectory(dir=folder.absolute().parent, prefix=".firm") as made:
        inner = Path(made) / folder.name
        inner.mkdir()
        try:
            yield inner
        except InputError as error:
            raise InputError(_without_places_in(inner, error.diagnostics)) from None
        shutil.copytree(inner, folder, symlinks=True, dirs_exist_ok=True)


def _without_places_in(folder: Path, faults: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    for fault in faults:
        is_inside = fault.source is not None and Path(fault.source.file).is_relative_to(folder)
        yield replace(fault, source=None) if is_inside else fault


def write_surroundings(folder: Path, name: str) -> None:
    """Write the files that make a folder a FuseSoC library `name`, beside our library."""
    write(folder / "fusesoc.conf", render("project/fusesoc.conf", {"name": name, "library": str(LINK)}))
    link_library(folder)
    write(folder / ".gitignore", _IGNORED)
    write(folder / "build" / "FUSESOC_IGNORE", "")


def files_of(folder: Path) -> list[Path]:
    """Return all files in a project, relative to its folder."""
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


def _write_all(project: Project, folder: Path, known: Libraries, paths: Sequence[str]) -> None:
    ros, stimuli = middleware_of(project.ros), project.stimuli
    taken, given = (_frame(name, ros, known) for name in (project.input, project.output))
    spec = folder / f"{project.name}.yaml"
    context = _specification(project, ros, taken, given) | {"max_length": _max_length(project, taken, known)}
    write(spec, render("project/specification.yaml", context))
    loaded = load_system(spec, known, needs_sources=False)
    arithmetic = _ARITHMETIC.get(project.language)
    has_arithmetic = project.language in ("vhdl", "verilog")
    for path, text in missing_sources(loaded.system, folder, has_arithmetic=has_arithmetic).items():
        write(path, text)
    if stimuli:
        stimuli.write(folder / stimuli.name)
        paths = [stimuli.name, *paths]
    else:
        write(folder / _STIMULI, first_stimuli(_SUBSCRIBER, taken, project.width))
    # A compiled function is its own model.
    model = "" if project.language == "python" else "model.py"
    if model:
        write(folder / model, render("project/model.py", _model(project, loaded, given)))
    bench = f"test_{project.name}.py" if project.has_bench else ""
    if bench:
        names = {"name": project.name, "spec": spec.name, "stimuli": _STIMULI}
        write(folder / bench, render("project/cocotb_bench.py", names))
    core = spec.with_suffix(".core")
    description = f"{project.input} to {project.output}"
    options = CoreOptions(
        description=description,
        depend=[arithmetic] if arithmetic else (),
        paths=paths,
        stimuli=stimuli.name if stimuli else _STIMULI,
        model=model,
        bench=bench,
    )
    write(core, new_core(loaded.system, spec.name, options))


def _frame(name: str, ros: Middleware, known: Libraries) -> Frame:
    message = known[ros].parse(name)
    return frame_of(message, known[ros].closure(message))


def _specification(project: Project, ros: Middleware, taken: Frame, given: Frame) -> Context:
    longest = project.stimuli.longest if project.stimuli else 0
    language = LANGUAGES[project.language]
    passes = bool(project.include) and project.input == project.output
    own = {"name": project.name, "type": language.type, "source": language.source.format(project.name)}
    accelerators: list[Context] = []
    buffer: list[int] = []
    if language.type == SOFTWARE:
        source = LANGUAGES["vhdl"].source.format(_FORWARDER)
        first = {"name": _FORWARDER, "type": "VHDL", "source": source, "next": project.name, "buffer": []}
        accelerators = [first | {"output": project.input, "length": [] if taken.is_fixed_size else ["given"]}]
        length: list[str] = []
    else:
        received = select(taken, dict.fromkeys(project.include)) if project.include else taken
        length, buffer = ([], []) if passes else _length(received, given, longest)
    accelerators.append(own | {"output": project.output, "length": length, "next": _PUBLISHER, "buffer": []})
    return {
        "name": project.name,
        "input": project.input,
        "output": project.output,
        "middleware": ros.words[0],
        "include": list(project.include),
        "passes": passes,
        "width": [project.width] if project.width != Project.width else [],
        "accelerators": accelerators,
        "subscriber": _SUBSCRIBER,
        "publisher": _PUBLISHER,
        "is_topic": not project.input_topic,
        "input_topic": project.input_topic,
        "output_topic": project.output_topic,
        "first": accelerators[0]["name"],
        "buffer": buffer,
    }


def usual_size_of(project: Project, known: Libraries) -> Usual | None:
    """Return the usual size of a new project's input, or None if a bag or the definition tells its length."""
    ros = middleware_of(project.ros)
    if project.stimuli or bounded_payload(_frame(project.input, ros, known)) is not None:
        return None
    return usual_size(known[ros].closure(parse_name(project.input)))


def _max_length(project: Project, taken: Frame, known: Libraries) -> list[Context]:
    """Return the bytes of the longest payload and the reason, if the default is too small."""
    if project.stimuli and project.stimuli.longest > longest_payload(taken):
        return [{"bytes": _power_of_two(project.stimuli.longest), "reason": "as in the bag"}]
    usual = usual_size_of(project, known)
    return [{"bytes": usual.bytes, "reason": usual.example}] if usual else []


def _power_of_two(size: int) -> int:
    """Return the least power of two that is not less than a number of bytes."""
    return 1 << (size - 1).bit_length()


def _length(taken: Frame, given: Frame, longest: int) -> tuple[list[str], list[int]]:
    """Return the source of the output's length and the publisher's buffer, each empty for the default.

    With a counted length, all equal strings and arrays can be forwarded.
    """
    if given.is_fixed_size:
        return [], []
    if taken.message == given.message:
        return ["given"], []
    kinds = {node.path: node for node in given.nodes if isinstance(node, Data | Loop)}
    shared = equal_paths(taken, given) & kinds.keys()
    if sent_length_of(given).is_computed and len(shared) <= 1:
        return [], []
    return ["buffered"], [max(_BUFFER, _power_of_two(longest))]


def _model(project: Project, loaded: LoadedSystem, given: Frame) -> Context:
    types = {str(item.accelerator.name): item for item in loaded.system.accelerator_types}
    if project.name not in types:
        # The function is the model of its own answers.
        return {"name": project.name, "forwarded": {"block": f"{project.name}_in"}, "answer": None}
    (wires,) = wires_of(types[project.name])
    values = copied_fields(given, dict.fromkeys(wires.paths, "message"))
    return {"name": project.name, "forwarded": None, "answer": {"publisher": _PUBLISHER, "values": values}}
