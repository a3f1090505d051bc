"""Input that is huge, endless or nonsensical: one message at its place, soon, and never a traceback.

Each test that must end soon runs in a child with limited processor time, since such a fault would never end by itself.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fusesoc_firm.builds.call.lock_file import read_lock
from fusesoc_firm.cli import main
from fusesoc_firm.converter.config_file import read_config
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.bounds import MOST_FIELDS, MOST_LEVELS
from fusesoc_firm.message.joint import signature_of_text
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_message, parse_name
from fusesoc_firm.runs.simulation.stimuli import read_stimuli
from fusesoc_firm.system.boards.board import read_board
from fusesoc_firm.system.written.specification import read_specification
from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from fusesoc_firm.text.yaml_text import yaml_data

# The limit of a child's processor time in seconds; each takes one or two. A child that waits forever is ended, too.
_TIME = 20


def limited(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with limited processor time."""
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=4 * _TIME,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (_TIME, _TIME)),
    )


def write_chain(folder: Path, levels: int, text: str, leaf: str) -> None:
    """Write the messages `L0` to `L<levels - 1>`; X in `text` is the message of the level below."""
    folder.mkdir(parents=True)
    for level in range(levels):
        lines = text.replace("X", f"L{level - 1}") if level else leaf
        (folder / f"L{level}.msg").write_text(lines, encoding="utf-8")


# --- messages ------------------------------------------------------------------------------------------------------

DEEP = {
    "plain": "uint8 k\nX x\nuint16 e\n",
    "sequence": "uint8 k\nstring s\nX[] x\nfloat64 d\n",
    "bounded": "uint8 k\nstring<=5 s\nX[<=7] x\nuint16 e\n",
    "array": "uint8 k\nstring s\nX[1] x\nuint16 e\n",
}
_GENERATE = """
import sys
from pathlib import Path
from fusesoc_firm.converter.stages import STAGES
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.complexity import statistics

for ros in (ROS1, ROS2):
    library = MessageLibrary(ros, [Path(sys.argv[1])])
    for word in sys.argv[2:]:
        name = parse_name(word)
        if not (ros is ROS1 and "bounded" in word):
            definitions = library.closure(name)
            assert statistics(name, definitions).depth == 60
            print(*(len(text(name, definitions, 8)) for stage, text in STAGES.items() if stage != "config"))
"""


def test_messages_of_60_levels_are_generated(tmp_path: Path) -> None:
    for name, text in DEEP.items():
        # If all parts are bounded, so is the whole, and its maximum length is known.
        bound = "<=9" if name == "bounded" else ""
        write_chain(tmp_path / name, 60, text, f"uint8 a\nstring{bound} s\nfloat64 d\n")
    done = limited("-c", _GENERATE, str(tmp_path), *(f"{name}/L59" for name in DEEP))
    assert done.returncode == 0, done.stderr[-2000:]
    assert len(done.stdout.splitlines()) == 2 * len(DEEP) - 1


TOO_LARGE = {
    "ten": (9, "".join(f"X f{number}\n" for number in range(10)), "L4.msg:2:1", "field 'f1' makes 'ten/L4' too large"),
    "two": (60, "X[] x\nX[] y\n", "L11.msg:2:1", "fields, including those of nested messages"),
    "hollow": (60, "X x\nX y\n", "L12.msg:2:1", "8190 fields"),
    "deep": (MOST_LEVELS + 1, "X x\n", "L1.msg:1:1", "'deep/L64' contains 'deep/L0' 65 levels deep"),
    "chain": (3000, "X x\n", "L2936.msg:1:1", "'chain/L2999' contains 'chain/L2935' 65 levels deep"),
}


@pytest.mark.parametrize("name", TOO_LARGE)
def test_messages_beyond_the_bounds_are_refused(name: str, tmp_path: Path) -> None:
    levels, text, place, words = TOO_LARGE[name]
    write_chain(tmp_path / name, levels, text, "" if name == "hollow" else "uint8 a\n")
    done = limited("-m", "fusesoc_firm.cli", "message", "show", f"{name}/L{levels - 1}", "--path", str(tmp_path))
    assert (done.returncode, done.stderr.count("error:")) == (1, 1)
    assert f"{name}/{place}: error: " in done.stderr and words in done.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("B[65535] b\n", "field 'c' makes 'big/B' too large: 196605 fields"),
        ("Nothing[4294967295] n\n", "4294967295 fields, including those of each element in fixed arrays"),
        ("string[4294967295] n\n", "4294967295 fields"),
        ("uint8[4294967295] n\n", "4294967295 bytes of fixed size"),
        ("uint8[65536] n\nuint8 o\n", "65537 bytes"),
        ("".join(f"uint8 f{number}\n" for number in range(MOST_FIELDS + 1)), "4097 fields"),
        ("".join(f"uint8 F{number}=1\n" for number in range(MOST_FIELDS + 1)), "4097 constants"),
        ("uint8 a\n" * 40000, "larger than 262144 bytes"),
        ("?\n" * 5000, "and 4800 more"),
        (f"uint8 A={'1' * 5000}\n", "legal here: whole numbers"),
        (f"uint8[{'1' * 5000}] a\n", "is not a legal size"),
        ("uint8 a\0b\n", "is not a legal field name"),
    ],
)
def test_a_message_beyond_the_bounds_is_refused_at_its_place(text: str, words: str, tmp_path: Path) -> None:
    folder = tmp_path / "big"
    folder.mkdir()
    for name, content in {"Nothing": "", "C": "uint8 a\nuint16 b\n", "B": "C[65535] c\n", "A": text}.items():
        (folder / f"{name}.msg").write_text(content, encoding="utf-8")
    with pytest.raises(InputError) as raised:
        MessageLibrary(ROS2, [tmp_path]).closure(MessageName("big", "A"))
    assert words in str(raised.value)
    assert str(raised.value).startswith(str(folder))


def test_what_is_at_the_bounds_is_legal(tmp_path: Path) -> None:
    write_chain(tmp_path / "full", MOST_LEVELS, "X x\n", "uint8[65536] a\n")
    names = "".join(f"uint8 F{number}=1\nEmpty f{number}\n" for number in range(MOST_FIELDS // 2))
    (tmp_path / "full" / "Wide.msg").write_text(names, encoding="utf-8")
    (tmp_path / "full" / "Empty.msg").write_text("", encoding="utf-8")
    library = MessageLibrary(ROS1, [tmp_path])
    assert len(library.closure(MessageName("full", f"L{MOST_LEVELS - 1}"))) == MOST_LEVELS
    assert len(library.closure(MessageName("full", "Wide"))) == 2


def _link_loop(path: Path) -> None:
    path.symlink_to(path)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (os.mkfifo, "it is not a regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "it is not a regular file"),
        (_link_loop, "Too many levels of symbolic links"),
        (lambda path: path.symlink_to("nowhere"), "No such file or directory"),
    ],
)
def test_what_is_no_file_is_not_read(make: Callable[[Path], None], reason: str, tmp_path: Path) -> None:
    folder = tmp_path / "odd"
    folder.mkdir()
    make(folder / "A.msg")
    # A manifest of this kind does not name the package.
    make(folder / "package.xml")
    done = limited("-m", "fusesoc_firm.cli", "message", "show", "odd/A", "--path", str(tmp_path))
    assert (done.returncode, done.stderr) == (1, f"{folder}/A.msg:1:1: error: cannot read {folder}/A.msg: {reason}\n")
    make(tmp_path / "spec.yaml")
    done = limited("-m", "fusesoc_firm.cli", "system", "show", str(tmp_path / "spec.yaml"))
    assert (done.returncode, done.stderr) == (1, f"error: cannot read {tmp_path}/spec.yaml: {reason}\n")


def test_definitions_in_a_connection_are_bounded() -> None:
    parting = "=" * 80
    cycle = f"A a\n{parting}\nMSG: m/A\nTop t\n"
    chain = "L0 a\n" + "".join(f"{parting}\nMSG: m/L{level}\nL{level + 1} x\n" for level in range(3000))
    for text in (cycle, f"{chain}{parting}\nMSG: m/L3000\nuint8 a\n"):
        assert signature_of_text(MessageName("m", "Top"), text, ROS1) is None


# --- specifications ------------------------------------------------------------------------------------------------

SPECIFICATION = """project: {{name: q{project}}}
accelerators:
  - name: A
    type: VHDL
    sources: {source}
    interface:
      input: [{{middleware: ROS2, message: geometry_msgs/Point}}]
      output: [{{middleware: ROS2, message: geometry_msgs/Point}}]
blocks:
  - {{name: s, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: a}}]}}
  - {{name: a, type: A, outgoing: [{{name: p}}]}}
  - {{name: p, middleware: ROS2, mode: publisher, message: geometry_msgs/Point{publisher}}}
"""


def shown(text: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """The output of `firm system show` for a faulty specification."""
    (folder / "a.vhd").write_text("entity\n", encoding="utf-8")
    (folder / "spec.yaml").write_text(text, encoding="utf-8")
    assert main(["system", "show", str(folder / "spec.yaml")]) == 1
    return capsys.readouterr().err.replace(f"{folder}/", "")


@pytest.mark.parametrize(
    ("part", "value", "place", "words"),
    [
        ("project", ", width: " + "1" * 5000, "1:27", "'width' must be an integer"),
        ("project", ', width: !!int "touch"', "1:27", "'width' must be an integer, not 'touch'"),
        ("project", ", width: !!int '1:2:'", "1:27", "'width' must be an integer, not '1:2:'"),
        ("project", ", clock: " + "1" * 190 + " MHz", "1:27", "'clock' cannot be"),
        ("project", ", clock: " + "1" * 400 + " MHz", "1:27", "'clock'"),
        ("project", ", clock: 100 GHz", "1:27", "'clock' cannot be '100 GHz'"),
        ("project", ", clock: 0.1 Hz", "1:27", "'clock' cannot be '0.1 Hz'"),
        ("project", ", shortestRun: 2147483648", "1:33", "legal here: 1 to 2147483647 beats"),
        ("publisher", ", period: " + "9" * 190, "12:88", "'period' cannot be"),
        ("publisher", ", deadline: 0." + "0" * 190 + "1 s", "12:90", "'deadline' cannot be"),
        ("source", "a" * 5000 + ".vhd", "5:14", "source"),
    ],
)
def test_a_number_that_nothing_holds_is_one_fault(
    part: str, value: str, place: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = {"project": "", "publisher": "", "source": "a.vhd"} | {part: value}
    faults = shown(SPECIFICATION.format(**parts), tmp_path, capsys)
    assert faults.startswith(f"spec.yaml:{place}: error: ") and words in faults
    assert faults.count("error:") == 1


_NINE_TIMES = "".join(f"{name}: &{name} [{', '.join([f'*{above}'] * 9)}]\n" for above, name in pairwise("abcdefg"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 3000, "spec.yaml:1:65: error: the file is too large: more than 64 levels"),
        ("project: " + "[" * 3000 + "]" * 3000, "spec.yaml:1:73: error: the file is too large: more than 64 levels"),
        ("blocks:\n" + "- {name: b}\n" * 100_000, "spec.yaml: it is larger than 1048576 bytes"),
        ("blocks:\n" + "- a\n" * 100_000, "spec.yaml:49999:3: error: the file is too large: more than 50000 values"),
        ("a: &a [x, x, x, x, x, x, x, x, x]\n" + _NINE_TIMES, "the file is too large: more than 50000 values"),
        (
            "&a {project: *a, blocks: [*a]}",
            "spec.yaml:1:14: error: invalid YAML: the alias '*a' is inside its own value",
        ),
    ],
)
def test_yaml_is_bounded(text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert words in shown(text, tmp_path, capsys)


@pytest.mark.check
def test_400_accelerators_are_shown(tmp_path: Path) -> None:
    count = 400
    side = "[{middleware: ROS2, message: geometry_msgs/Point}]"
    accelerators = "".join(
        f"  - {{name: A{number}, type: VHDL, sources: a.vhd, interface: {{input: {side}, output: {side}}}}}\n"
        for number in range(count)
    )
    ends = "  - {{name: {}, middleware: ROS2, mode: {}, message: geometry_msgs/Point{}}}\n"
    blocks = ends.format("s", "subscriber", ", outgoing: [{name: b0}]") + ends.format(f"b{count}", "publisher", "")
    blocks += "".join(f"  - {{name: b{n}, type: A{n}, outgoing: [{{name: b{n + 1}}}]}}\n" for n in range(count))
    (tmp_path / "a.vhd").write_text("entity\n", encoding="utf-8")
    text = f"project: {{name: many}}\naccelerators:\n{accelerators}blocks:\n{blocks}"
    (tmp_path / "spec.yaml").write_text(text, encoding="utf-8")
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = limited("-m", "fusesoc_firm.cli", "system", "show", str(tmp_path / "spec.yaml"))
    assert (done.returncode, done.stdout.count("entity: ")) == (0, count)
    # It takes 2 s; it took 12 s and more when every accelerator requested all names of the top level.
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 8


# --- nonsense ------------------------------------------------------------------------------------------------------

# Words and letters that are special to the readers.
_WORDS = st.sampled_from(
    [
        *"project blocks name messages cores : - { } [ ] &a *a !!int !!binary 2001-99-99 1:59:59 0x ' # | >".split(),
        *'uint8 string [<= = --- Header / é % @ ? <<: "'.split(),
        *["\n", "\n  ", "\0", "\x0c", "\x85", "\ufeff", "\ud83e", "\r", "\t", " ", ": ", "- ", "9" * 5000],
    ]
)
_TEXTS = st.one_of(st.text(), st.lists(_WORDS, max_size=30).map("".join))
GARBAGE = st.one_of(_TEXTS.map(lambda text: text.encode("utf-8", "surrogatepass")), st.binary())
READERS: dict[str, Callable[[Path], object]] = {
    "specification": lambda path: read_specification(path, "x.yaml", Diagnostics()),
    "config": lambda path: read_config(path, Diagnostics()),
    "board": lambda path: read_board(path.name, path.parent),
    "stimuli": lambda path: read_stimuli(path, ()),
    "lock": read_lock,
    "ros1": lambda path: MessageLibrary(ROS1, [path.parent]).closure(parse_name("garbage/X")),
    "ros2": lambda path: MessageLibrary(ROS2, [path.parent]).closure(parse_name("garbage/X")),
}


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=GARBAGE)
@pytest.mark.parametrize("reader", READERS)
def test_no_reader_stumbles_over_garbage(reader: str, data: bytes, tmp_path: Path) -> None:
    folder = tmp_path / "garbage"
    folder.mkdir(exist_ok=True)
    path = folder / ("X.msg" if reader.startswith("ros") else "x.yaml")
    path.write_bytes(data)
    with suppress(InputError):
        READERS[reader](path)


@settings(max_examples=200, deadline=None)
@given(data=GARBAGE)
def test_no_text_stumbles_over_garbage(data: bytes) -> None:
    text = data.decode("utf-8", "replace")
    with suppress(yaml.YAMLError):
        yaml_data(text)
    for ros in (ROS1, ROS2):
        parse_message(text, MessageName("a", "A"), ros, "A.msg", Diagnostics())
