"""The kernels of the bench answer random messages as their functions do, as systems in Verilator."""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import encode
from fusesoc_firm.runs.verify.stimuli import EMPTY, TYPICAL, Stimuli
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import LoadedSystem
from tests.compiler.compiled import random_number
from tests.seeds import seeded
from tools.bench.kernels import KERNELS

SEED = seeded(20261203)
SPECS = [pytest.param(spec, id=spec.stem) for spec in sorted({kernel.spec for kernel in KERNELS})]
# Of arrays: the buffer of an answer has 64 bytes.
_LONGEST = 5
_ANY = 1 << 16


class _Mixed(Stimuli):
    """Messages whose floats are ordinary, special and subnormal ones."""

    def _number(self, name: str, kind: str) -> Any:
        if name.startswith("float") and kind != EMPTY:
            return random_number(name, (0, 0), self.chance)
        return super()._number(name, kind)


def _stimuli(spec: Path, count: int) -> list[dict[str, Any]]:
    """`count` messages for each subscriber of a system, in turn: an accelerator may wait for one of each."""
    source = random.Random(SEED)
    loaded = load_beside(spec, [path] if (path := spec.parent / "msg").is_dir() else [])
    drawn = [(item, _messages(loaded, item, source)) for item in loaded.system.subscribers]
    return [{item.block: next(messages)} for _ in range(count) for item, messages in drawn]


def _messages(loaded: LoadedSystem, subscriber: Converter, source: random.Random) -> Iterator[dict[str, Any]]:
    """Yield messages that are not too long for a subscriber."""
    frame = subscriber.frame
    stimuli = _Mixed(loaded.libraries[frame.ros].closure(frame.message), frame.ros, source, _LONGEST)
    while True:
        message = stimuli.message(frame.message, EMPTY if source.random() < 0.05 else TYPICAL)
        if len(encode(frame, message)) <= (subscriber.max_length or _ANY):
            yield message


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [*map(_plain, value)] if isinstance(value, list | tuple | bytes) else value


@pytest.mark.thorough
@pytest.mark.skipif(not shutil.which("verilator"), reason="no verilator")
@pytest.mark.parametrize("spec", SPECS)
@pytest.mark.parametrize("count", [10_000])
def test_kernels_answer_random_messages(
    spec: Path, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    print("seed", SEED)
    folder = tmp_path / spec.parent.name
    shutil.copytree(spec.parent, folder, ignore=shutil.ignore_patterns("*.core", "model*.py", "build"))
    copied = folder / spec.name
    stimuli = [_plain(message) for message in _stimuli(copied, count)]
    (folder / "random.yaml").write_text(yaml.dump(stimuli, Dumper=yaml.CSafeDumper, allow_unicode=True), "utf-8")
    monkeypatch.chdir(folder)
    paths = ["--path", "msg"] if (folder / "msg").is_dir() else []
    assert main(["system", "core", spec.name, "--stimuli", "random.yaml", *paths]) == 0
    assert main(["sim", spec.name, "--tool", "verilator"]) == 0
    assert "PASS" in capsys.readouterr().out
