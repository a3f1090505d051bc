"""What a proof is: a harness, the entity it is about, the sizes it is done at, and faults that it must find."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.hdl.ghdl import Generic, Library, core_files
from tools.bench.designs import Converter, write_converter
from tools.proofs.collisions import with_collisions
from tools.proofs.smtbmc import Outcome, Task

HARNESSES = Path(__file__).parent / "harness"

_LABEL = re.compile(r"\b(\w+): assert\b")
_HELPER = "helper_"
_INCLUDE = re.compile(r'^`include "(\S+)"', re.MULTILINE)
# A harness of several entities includes under this name what ties it to the registers of the one.
_HELPERS = "helpers.svh"


# Generics of an entity.
Size = Mapping[str, Generic]


class MutationError(Exception):
    """What a mutation replaces is not there."""


@dataclass(frozen=True)
class Mutation:
    """A fault in a copy of `file`: `old` stands there once, and with `new` instead each of `violates` must fail.

    It is tried at the first of the proof's sizes or, if only another one shows it, at that of the index `size`.
    """

    file: str
    old: str
    new: str
    violates: tuple[str, ...]
    size: int = 0


@dataclass(frozen=True)
class Proof:
    """All assertions of `harness` for an entity of `cores`, at each of `sizes`, its generics.

    It is done by induction over `depth` cycles or, `is_bounded`, for all traces of so many cycles from reset or, with
    `finds_invariant`, by an inductive invariant that is searched for. `trace` is the length of the traces that are
    searched for what a mutation violates. The harness gets the generics and `defines` as macros, and `PUBLISHERS_4`,
    for `ifdef`, where PUBLISHERS is 4. `sources` are VHDL files beside the harness, such as a wrapper; `helpers` is the
    entity's own part of a harness that is for several. With a `converter`, the entity is a generated one.
    """

    harness: str
    entity: str
    cores: tuple[str, ...]
    sizes: tuple[Size, ...]
    depth: int
    mutations: tuple[Mutation, ...]
    defines: Mapping[str, object] = field(default_factory=dict)
    sources: tuple[str, ...] = ()
    helpers: str = ""
    variant: str = ""
    trace: int = 12
    is_bounded: bool = False
    finds_invariant: bool = False
    # Further sizes, which take minutes, so that tests prove them only if they are thorough.
    long_sizes: tuple[Size, ...] = ()
    converter: Converter | None = None

    @property
    def name(self) -> str:
        """`scheduler_grants of firm_sched_fixed_priority, preemptive`."""
        return f"{self.harness} of {self.entity}{self.variant and ', '}{self.variant}"

    @property
    def method(self) -> str:
        """`induction over 4 cycles`, `all traces of 16 cycles`, or `inductive invariant (PDR)`."""
        if self.finds_invariant:
            return "inductive invariant (PDR)"
        return f"all traces of {self.depth} cycles" if self.is_bounded else f"induction over {self.depth} cycles"

    @property
    def properties(self) -> list[str]:
        """The labels of what is proved, in order, but for the invariants that are only there for the induction."""
        labels = [label for text in self._texts().values() for label in _LABEL.findall(text)]
        return [label for label in labels if not label.startswith(_HELPER)]

    def prove(self, size: Size, folder: Path) -> Outcome:
        """Prove all assertions at a size; `folder` is empty."""
        task = self._task(self._sources(folder), size, folder)
        if self.finds_invariant:
            return task.prove_by_invariant(folder, self.depth)
        return task.check(folder, self.depth) if self.is_bounded else task.prove(folder, self.depth)

    def search(self, mutation: Mutation, label: str, folder: Path) -> Outcome:
        """Look for a trace in which a broken copy violates an assertion; `folder` is empty."""
        files = _mutated(self._sources(folder), mutation, folder)
        return self._task(files, self.sizes[mutation.size], folder).search(folder, self.trace, label)

    def _sources(self, folder: Path) -> list[Path]:
        generated = write_converter(self.converter, folder) if self.converter else []
        return [*core_files(*self.cores), *(HARNESSES / name for name in self.sources), *generated]

    def _task(self, files: Sequence[Path], size: Size, folder: Path) -> Task:
        library = Library("firm", folder)
        library.analyse(files)
        netlist = with_collisions(library.synthesise(self.entity, size, "verilog"))
        generics = {name: int(value) for name, value in size.items()}
        choices = {f"{name}_{value}": 1 for name, value in generics.items()}
        defines = {**self.defines, **generics, **choices}
        return Task(f"{self.harness}.sv", {**self._texts(), "netlist.v": netlist}, defines)

    def _texts(self) -> dict[str, str]:
        """The harness and what it includes, by the name under which it does."""
        name = f"{self.harness}.sv"
        harness = (HARNESSES / name).read_text(encoding="utf-8")
        texts = {name: harness} | {included: self._included(included) for included in _INCLUDE.findall(harness)}
        return texts | {
            included: self._included(included) for text in texts.values() for included in _INCLUDE.findall(text)
        }

    def _included(self, name: str) -> str:
        if name == _HELPERS:
            name = f"{self.helpers}.svh"
        return (HARNESSES / name).read_text(encoding="utf-8")


def _mutated(files: Sequence[Path], mutation: Mutation, folder: Path) -> list[Path]:
    """The files, with a broken copy in `folder` in the place of one."""
    original = next((file for file in files if file.name == mutation.file), None)
    if not original:
        raise MutationError(f"{mutation.file} is none of the files")
    text = original.read_text(encoding="utf-8")
    if text.count(mutation.old) != 1:
        raise MutationError(f"{mutation.file} holds {text.count(mutation.old)} times: {mutation.old}")
    copy = folder / mutation.file
    copy.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")
    return [copy if file == original else file for file in files]
