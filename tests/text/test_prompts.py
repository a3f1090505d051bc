"""Questions: the same rules for answers from a pipe and from a terminal."""

from __future__ import annotations

import io

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.prompts import PipeAsker, Question, TerminalAsker

COLOUR = Question("colour", "the lamp's colour", ("red", "green"), is_choice=True, default="red")
NAME = Question("name", "what it is called", is_required=True, check=lambda answer: "too long" if answer[4:] else None)
NOTE = Question("note", "anything")


def test_answers_from_a_pipe_are_shown_with_their_questions() -> None:
    output = io.StringIO()
    asker = PipeAsker(["Bob\n", "\n", " green \n", "\n"], output)
    assert [asker.ask(question) for question in (NAME, COLOUR, COLOUR, NOTE)] == ["Bob", "red", "green", ""]
    asker.tell("thanks")
    assert output.getvalue().splitlines() == [
        "name: Bob",
        "colour [red]: ",
        "colour [red]: green",
        "note (Enter: none): ",
        "thanks",
    ]


@pytest.mark.parametrize(
    ("question", "answers", "message"),
    [
        (COLOUR, ["gren"], "answer 1: 'colour' cannot be 'gren'; did you mean 'green'?"),
        (NAME, [""], "answer 1: 'name' is required: what it is called"),
        (NAME, ["Barbara"], "answer 1: too long"),
        (NAME, [], "the answers end before 'name': what it is called"),
    ],
)
def test_a_wrong_answer_from_a_pipe_ends_it(question: Question, answers: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        PipeAsker(answers, io.StringIO()).ask(question)


@pytest.mark.parametrize(
    ("question", "typed", "answer"),
    [
        # Enter after an invalid answer does nothing; Ctrl-U empties the line.
        (COLOUR, "blue\r\x15green\r", "green"),
        (NAME, "\rBarbara\r\x15Bob\r", "Bob"),
        (COLOUR, "\r", "red"),
    ],
)
def test_a_terminal_asks_again(question: Question, typed: str, answer: str) -> None:
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        keys.send_text(typed)
        assert TerminalAsker().ask(question) == answer


def test_a_terminal_can_be_left() -> None:
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        keys.send_text("\x04")
        with pytest.raises(KeyboardInterrupt):
            TerminalAsker().ask(NAME)
