"""The hook of git accepts a message that follows the rules of CONTRIBUTING.md, and names each broken rule."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HOOK = Path(__file__).resolve().parents[2] / ".ci" / "hooks" / "commit-msg"
LONG = "word " * 20 + "end"
COMMENTS = "# Please enter the commit message.\n# ------------------------ >8 ------------------------\n"


def refusals(message: str, folder: Path) -> list[str]:
    """What the hook prints for a message."""
    file = folder / "COMMIT_EDITMSG"
    file.write_text(message, encoding="utf-8")
    done = subprocess.run([sys.executable, HOOK, file], text=True, capture_output=True, check=False)
    assert done.returncode == bool(done.stderr)
    return done.stderr.splitlines()


@pytest.mark.parametrize(
    "message",
    [
        "",
        f"{'é' * 72}\n",
        f"Subject\n\n{'b' * 99}.\n",
        f"Subject\n\n  https://example.org/{LONG.replace(' ', '-')}\n",
        f"Subject\n\nBody\n{COMMENTS}diff --git {LONG}\n",
        f"Subject\n# {LONG}\n",
        f"Merge branch '{'b' * 80}'\n",
        f'Revert "{"s" * 72}"\n\nThis reverts commit 0123.\n',
        f"fixup! {'s' * 72}\n",
    ],
)
def test_a_message_that_follows_the_rules_is_accepted(message: str, tmp_path: Path) -> None:
    assert refusals(message, tmp_path) == []


@pytest.mark.parametrize(
    ("message", "refused"),
    [
        (f"{'s' * 73}\n", ["The subject has 73 characters; at most 72 are allowed."]),
        (
            "Subject\nBody\n",
            ["The second line is not empty; put an empty line between subject and body."],
        ),
        (f"Subject\n\nBody\n{LONG}\n", ["Line 4 has 103 characters; at most 100 are allowed."]),
        (
            f"{'s' * 80}\n{LONG}\n",
            [
                "The subject has 80 characters; at most 72 are allowed.",
                "The second line is not empty; put an empty line between subject and body.",
                "Line 2 has 103 characters; at most 100 are allowed.",
            ],
        ),
    ],
)
def test_each_broken_rule_is_one_sentence(message: str, refused: list[str], tmp_path: Path) -> None:
    assert refusals(message, tmp_path) == refused


def test_git_runs_the_hook(tmp_path: Path) -> None:
    def git(*arguments: str) -> subprocess.CompletedProcess[str]:
        identity = ["-c", "user.name=A", "-c", "user.email=a@example.org", "-c", f"core.hooksPath={HOOK.parent}"]
        return subprocess.run(
            ["git", *identity, *arguments], cwd=tmp_path, text=True, capture_output=True, timeout=60, check=False
        )

    assert git("init").returncode == 0
    assert git("commit", "--allow-empty", "--message", "s" * 73).returncode == 1
    assert git("commit", "--allow-empty", "--message", "Subject").returncode == 0
