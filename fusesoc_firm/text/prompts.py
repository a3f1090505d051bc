"""Ask questions at a terminal or through a pipe, with the same questions and the same rules for answers.

At a terminal, prompt_toolkit completes answers, explains the question and accepts only valid answers. From a pipe, each
line is an answer; an invalid answer ends the questions with an error at that line.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TextIO

from fusesoc_firm.text.diagnostics import fail, nearest

if TYPE_CHECKING:
    from prompt_toolkit import PromptSession
    from prompt_toolkit.document import Document


@dataclass(frozen=True)
class Question:
    """A question; `name` is a short name, and `meaning` is an explanation in one sentence.

    The `words` complete an answer; if `is_choice` is set, all other answers are illegal. An empty answer means
    `default`, which is empty if the answer is optional. If `is_required` is set without a default, an empty answer is a
    fault. `check` returns the fault in an answer.
    """

    name: str
    meaning: str
    words: Sequence[str] = ()
    is_choice: bool = False
    is_required: bool = False
    default: str = ""
    check: Callable[[str], str | None] = lambda _: None

    def fault(self, answer: str) -> str | None:
        """Return the fault in an answer, or None."""
        if not answer:
            return f"'{self.name}' is required: {self.meaning}" if self.is_required and not self.default else None
        if self.is_choice and answer not in self.words:
            return f"'{self.name}' cannot be '{answer}'; {nearest(answer, self.words)}"
        return self.check(answer)

    @property
    def prompt(self) -> str:
        """The text shown before the answer."""
        ending = f" [{self.default}]" if self.default else "" if self.is_required else " (Enter: none)"
        return f"{self.name}{ending}: "


class Asker(Protocol):
    """A source of answers."""

    def ask(self, question: Question) -> str:
        """Return the user's answer without surrounding blanks, or the question's default."""

    def tell(self, text: str) -> None:
        """Show a text to the user."""


class PipeAsker:
    """An asker that reads an answer from each line of a stream, and writes questions and answers to `output`."""

    def __init__(self, answers: Iterable[str], output: TextIO) -> None:
        self._answers = enumerate(answers, start=1)
        self._output = output

    def ask(self, question: Question) -> str:
        """Return the answer in the next line. Raise `InputError` for an invalid or missing answer."""
        line, text = next(self._answers, (0, ""))
        if not line:
            fail(f"the answers end before '{question.name}': {question.meaning}")
        answer = text.strip()
        print(f"{question.prompt}{answer}", file=self._output)
        if fault := question.fault(answer):
            fail(f"answer {line}: {fault}")
        return answer or question.default

    def tell(self, text: str) -> None:
        """Write a text between the questions."""
        print(text, file=self._output)


class TerminalAsker:
    """An asker at a terminal."""

    def __init__(self) -> None:
        from prompt_toolkit import PromptSession

        self._session: PromptSession[str] = PromptSession()

    def ask(self, question: Question) -> str:
        """Ask until the answer is valid; Ctrl-D acts like Ctrl-C."""
        from prompt_toolkit.completion import FuzzyWordCompleter
        from prompt_toolkit.validation import ValidationError, Validator

        class Check(Validator):
            def validate(self, document: Document) -> None:
                if fault := question.fault(document.text.strip()):
                    raise ValidationError(len(document.text), fault)

        try:
            answer = self._session.prompt(
                question.prompt,
                completer=FuzzyWordCompleter([*question.words]),
                validator=Check(),
                validate_while_typing=False,
                bottom_toolbar=question.meaning,
            )
        except EOFError:
            raise KeyboardInterrupt from None
        return answer.strip() or question.default

    def tell(self, text: str) -> None:
        """Print a text between the questions."""
        print(text)


def asker() -> Asker:
    """Return the asker for the kind of the standard input: a terminal or a pipe."""
    if sys.stdin.isatty() and sys.stdout.isatty():
        return TerminalAsker()
    return PipeAsker(sys.stdin, sys.stdout)
