"""`firm system new`: the answers result in a specification as if written by hand."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import pytest

from fusesoc_firm.system.scaffold.wizard import extend_specification
from fusesoc_firm.system.written.specification import Accelerator, Block, Outgoing, Project
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.prompts import PipeAsker, Question
from fusesoc_firm.text.yaml_sections import keys_of
from tests.system.systems import connections, derived

POINT, VECTOR = "geometry_msgs/Point", "geometry_msgs/Vector3"


class Answers:
    """Answers by question, in turn, with defaults for the others; it records the questions."""

    def __init__(self, **answers: list[str]) -> None:
        self._answers = {name.replace("_", " "): [*given] for name, given in answers.items()}
        self.asked: list[Question] = []

    def add(self, **answers: list[str]) -> None:
        """Further answers; those of a question that is there begin with its first one."""
        for name, given in answers.items():
            before = self._answers.get(name.replace("_", " "), [])
            self._answers[name.replace("_", " ")] = given + before[1:]

    def ask(self, question: Question) -> str:
        self.asked.append(question)
        given = self._answers.get(question.name.replace("'", ""), [])
        answer = given.pop(0) if given else ""
        assert question.fault(answer) is None, (question.name, answer)
        return answer or question.default

    def tell(self, text: str) -> None:
        pass

    @property
    def is_used_up(self) -> bool:
        return not any(self._answers.values())


def turner(**others: list[str]) -> Answers:
    """A system of a subscriber, an accelerator and a publisher; some questions get `others` as answers."""
    answers = {
        "name": ["turn", "turner", "sub", "acc", "acc", "pub", "pub"],
        "width": ["16"],
        "add_to_accelerators": ["yes"],
        "type": ["VHDL", "", "turner", ""],
        "sources": ["acc.vhd"],
        "add_to_input": ["yes"],
        "add_to_output": ["yes"],
        "middleware": ["ROS", "ROS", "ROS", "ROS"],
        "message": [POINT, VECTOR, POINT, VECTOR],
        "mode": ["subscriber", "publisher"],
        "add_to_blocks": ["yes", "yes"],
        "add_to_outgoing": ["yes", "no", "yes", "no"],
        "period": ["500"],
    }
    return Answers(**{**answers, **others})


def run(path: Path, answers: Answers) -> str:
    extend_specification(path, answers, lambda _: [POINT, VECTOR])
    assert answers.is_used_up
    return path.read_text(encoding="utf-8")


def server() -> Answers:
    """A system whose only block is a server."""
    return Answers(name=["serve", "lamp"], middleware=["ROS"], mode=["server"], service=["demo/Switch"])


def test_a_server_is_asked_for_its_service(tmp_path: Path) -> None:
    answers = server()
    text = run(tmp_path / "robot.yaml", answers)
    assert "mode: server" in text
    assert "service: demo/Switch" in text
    asked = [question.name for question in answers.asked]
    assert "service" in asked
    assert not {"message", "include", "exclude", "timeLimit"} & {*asked[asked.index("mode") :]}


def test_a_new_specification(tmp_path: Path) -> None:
    text = run(tmp_path / "robot.yaml", turner())
    system = derived(tmp_path, text)
    assert (system.name, system.width) == ("turn", 16)
    assert connections(system) == ["sub. -> acc.in_", "acc.out_ -> pub."]
    assert system.scheduling.times[0].period == 500


def test_software_may_have_no_sources(tmp_path: Path) -> None:
    """`sources` is asked for all the same, and needed for any other type."""
    for kind, sources in (("VHDL", ["acc.vhd"]), ("ROS-SW", [])):
        answers = Answers(
            name=["turn", "turner", "in", "out", "out"],
            add_to_accelerators=["yes"],
            type=[kind],
            sources=sources,
            add_to_input=["yes"],
            middleware=["ROS", "ROS", "ROS"],
            message=[POINT, POINT, POINT],
            add_to_blocks=["yes"],
            mode=["subscriber", "publisher"],
            add_to_outgoing=["yes"],
        )
        text = run(tmp_path / f"{kind}.yaml", answers)
        (question,) = (question for question in answers.asked if question.name == "sources")
        assert question.is_required is (kind == "VHDL")
        assert ("sources" in text) is (kind == "VHDL")
        assert len(derived(tmp_path, text).subscribers) == 1


def test_the_paths_of_messages_decide_what_can_be_named(tmp_path: Path) -> None:
    (tmp_path / "msg").mkdir()
    answers = turner()
    answers.add(paths=["msg"], another_item_of_paths=["me:msgs:arm"])
    asked: list[Sequence[str]] = []

    def names(paths: Sequence[str]) -> list[str]:
        asked.append(paths)
        return [POINT, VECTOR]

    extend_specification(tmp_path / "robot.yaml", answers, names)
    assert "paths:" in (tmp_path / "robot.yaml").read_text()
    assert asked[0] == ["msg", "me:msgs:arm"]
    wrong = ["robot", *[""] * 8, "mgs"]
    with pytest.raises(InputError, match="answer 10: 'mgs' is not a folder, a bag or a core"):
        extend_specification(tmp_path / "other.yaml", PipeAsker(wrong, io.StringIO()), names)


def test_every_key_is_explained_once(tmp_path: Path) -> None:
    text = run(tmp_path / "robot.yaml", turner())
    assert text.count("# the system's name; the top level is <name>_system") == 1
    assert text.count("middleware: ROS") == 4
    assert text.count("# the middleware that defines the message") == 1


def test_every_key_of_the_grammar_is_asked_for(tmp_path: Path) -> None:
    answers = turner()
    run(tmp_path / "robot.yaml", answers)
    others = server()
    run(tmp_path / "server.yaml", others)
    asked = {question.name for question in (*answers.asked, *others.asked)}
    for section in (Project, Accelerator, Block, Outgoing):
        for name, (_, entry) in keys_of(section).items():
            is_asked = name in asked or f"add to '{name}'" in asked or (entry.form == "section" and entry.is_required)
            assert is_asked is entry.is_asked, name


def test_what_a_block_is_decides_what_is_asked(tmp_path: Path) -> None:
    answers = turner()
    run(tmp_path / "robot.yaml", answers)
    asked = [question.name for question in answers.asked]
    # Of the three blocks two are converters, and one of these is a publisher; two accelerators' messages ask, too.
    assert (asked.count("mode"), asked.count("period"), asked.count("buffer")) == (2, 1, 1)
    assert asked.count("middleware") == 4
    # The project has a clock, and an accelerator may have one.
    assert asked.count("clock") == 2


def test_a_block_may_have_a_clock_of_the_project(tmp_path: Path) -> None:
    answers = turner()
    answers.add(
        name=["turn", "camera"], add_to_clocks=["yes", "no"], frequency=["150 MHz"], clock=["100 MHz", "camera"]
    )
    system = derived(tmp_path, run(tmp_path / "robot.yaml", answers))
    assert [clock.port for clock in system.clocks] == ["clk_camera"]
    assert system.accelerators[0].clock == "camera"
    assert [question.words for question in answers.asked if question.name == "clock"][1] == ["camera"]


def test_answers_are_completed(tmp_path: Path) -> None:
    answers = turner()
    run(tmp_path / "robot.yaml", answers)
    words = {question.name: question.words for question in answers.asked if question.words}
    assert words["message"] == [POINT, VECTOR]
    assert words["type"] == ["turner"]
    assert "lru" in words["scheduler"]


def test_a_specification_that_is_there_is_extended(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    before = run(path, turner()).replace("blocks:", "# my blocks\nblocks:").replace("width: 16", "width: 0x10")
    path.write_text(before, encoding="utf-8")
    text = run(
        path,
        Answers(
            name=["copy", "copy"],
            add_to_blocks=["yes"],
            middleware=["ROS"],
            mode=["publisher"],
            message=[POINT],
            block=["sub"],
            add_to_outgoing=["no", "yes"],
        ),
    )
    assert connections(derived(tmp_path, text)) == ["sub. -> acc.in_, copy.", "acc.out_ -> pub."]
    assert "# my blocks" in text and "0x10" in text
    added = [line.strip() for line in text.splitlines() if line not in before.splitlines()]
    assert added == ["- name: copy", "- name: copy"]


def test_answers_read_well(tmp_path: Path) -> None:
    """A word, a list on one line, and double quotes only where a word would be something else without them."""
    answers = turner(
        name=["0x10", "turner", "on", "acc", "acc", "a, b", "a, b"],
        sources=["rtl/turn.vhd"],
        another_item_of_sources=["rtl/two.vhd", "rtl/three.vhd"],
        another_item_of_include=["no"],
        include=["x", "y"],
        fpgaPart=["007"],
        clock=["100 MHz"],
    )
    text = run(tmp_path / "robot.yaml", answers)
    for line in (
        'name: "0x10" # the system\'s name; the top level is <name>_system',
        'fpgaPart: "007" # the FPGA\'s part number',
        "clock: 100 MHz # frequency",
        "width: 16 # width in bits",
        "sources: [rtl/turn.vhd, rtl/two.vhd, rtl/three.vhd] # the accelerator's source files",
        'include: [x, "no"] # fields to include',
        "include: y\n",
        '- name: "on"\n',
        '- name: "a, b"\n',
    ):
        assert line in text, line
    # An answer after the second is asked for as the second is.
    assert max(question.name.count("another item of") for question in answers.asked) == 1


@pytest.mark.parametrize(("item", "dash"), [(2, 0), (4, 2), (6, 3)])
def test_a_specification_that_is_there_keeps_its_quotes_and_lists(tmp_path: Path, item: int, dash: int) -> None:
    """Only what is new is another line, and it stands as far in as its neighbours."""
    path = tmp_path / "robot.yaml"
    first, rest = f"{' ' * dash}-{' ' * (item - dash - 1)}", " " * item
    before = f"""project: {{name: "turn", 'clock': '100 MHz'}}
blocks:
{first}name: "sub"
{rest}middleware: 'ROS'
{rest}mode: subscriber
{rest}message: {POINT}
{rest}outgoing: [{{name: "pub"}}]
{first}{{name: pub, middleware: ROS, mode: publisher, message: "{POINT}"}}
"""
    path.write_text(before, encoding="utf-8")
    answers = Answers(
        name=["copy", "copy"],
        add_to_blocks=["yes"],
        middleware=["ROS"],
        mode=["publisher"],
        message=[POINT],
        block=["sub"],
        add_to_outgoing=["no", "yes"],
    )
    text = run(path, answers)
    new = f"{first}name: copy\n{rest}middleware: ROS\n{rest}mode: publisher\n{rest}message: {POINT}\n"
    assert text == before.replace('[{name: "pub"}]', '[{name: "pub"}, {name: copy}]') + new


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        (["robot", "", "7"], "answer 3: 'width' cannot be '7'"),
        (["robot", "", "", "", "many"], "answer 5: 'shortestRun' must be an integer, not 'many'"),
        (["robot", *[""] * 9, "no", "a", "b"], "answer 13: 'type' cannot be 'b'"),
        (["robot", *[""] * 9, "no", "a", "", "ROS", "subscriber", ""], "answer 16: 'message' is required"),
    ],
)
def test_a_wrong_answer_writes_nothing(tmp_path: Path, answers: list[str], message: str) -> None:
    path = tmp_path / "robot.yaml"
    with pytest.raises(InputError, match=message):
        extend_specification(path, PipeAsker(answers, io.StringIO()), list)
    assert not path.exists()


def test_no_block_is_called_like_another(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    answers = ["robot", *[""] * 9, "no", "a", "", "ROS", "subscriber", POINT, "", "", "", "", "", "no", "yes", "a"]
    with pytest.raises(InputError, match="answer 24: 'a' already exists"):
        extend_specification(path, PipeAsker(answers, io.StringIO()), list)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- a\n", "robot.yaml is not a specification"),
        (
            "project: {name: a}\nblocks: &b\n  - {name: a, middleware: ROS, mode: publisher, message: demo/A}\nx: *b\n",
            "cannot extend .*robot.yaml: this place is written in a form that can be edited only by hand",
        ),
    ],
)
def test_a_file_that_cannot_be_extended_is_not_changed(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    answers = ["no", "yes", "b", "", "ROS", "publisher", POINT, *[""] * 20]
    with pytest.raises(InputError, match=message):
        extend_specification(path, PipeAsker(answers, io.StringIO()), list)
    assert path.read_text(encoding="utf-8") == text
