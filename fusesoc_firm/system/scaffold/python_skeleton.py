"""A first version of an accelerator in software: a function that copies equal fields, and sends defaults elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from fusesoc_firm.frame.codec import decode
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.model import Data, Fixed, Frame, Loop, Node, Path, names_of
from fusesoc_firm.frame.select import used_part, with_names_in_use
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.derived.python_function import function_name, parameter_names
from fusesoc_firm.system.scaffold.pass_through import equal_paths, top_paths
from fusesoc_firm.text.quoting import python_string
from fusesoc_firm.text.render import Context


def python_skeleton(type_: AcceleratorType) -> Context:
    """Return the template configuration of the function's first version."""
    parameters = parameter_names(type_)
    count = len(type_.outputs)
    answers = ["answer"] if count == 1 else [f"answer{number}" for number in range(count)]
    return {
        "function": function_name(type_),
        "parameters": ", ".join(parameters),
        "inputs": [_described(name, side.frame) for name, side in zip(parameters, type_.inputs, strict=True)],
        "outputs": [
            {**_described(name, side.frame), "values": copied_fields(side.frame, _sources(type_, side.frame))}
            for name, side in zip(answers, type_.outputs, strict=True)
        ],
        "answer": ", ".join(answers) or "None",
    }


def _described(name: str, frame: Frame) -> Context:
    """Return a message with its used fields and their types."""
    fields = dict(_fields(frame.nodes, "", 0))
    return {
        "name": name,
        "message": str(frame.message),
        "fields": [{"field": field, "type": type_} for field, type_ in fields.items()],
    }


def _fields(nodes: Iterable[Node], above: str, depth: int) -> Iterator[tuple[str, str]]:
    """Yield the path and type of each used leaf; a path is `above` and the leaf's names after the first `depth`."""
    for node in nodes:
        match node:
            case Fixed(fields=leaves):
                for leaf in leaves:
                    if leaf.is_used:
                        yield f"{above}{_shown(leaf.path[depth:])}", f"{leaf.type.name}{_size(leaf.path)}"
            case Data() if node.is_used and len(node.path) > depth:
                yield f"{above}{_shown(node.path[depth:])}", node.ros_type
            case Loop() if node.is_used:
                path = f"{above}{_shown(node.path[depth:])}"
                yield path, node.ros_type
                if node.has_fields:
                    yield from _fields(node.body, f"{path}[].", len(node.path))


def _shown(path: Path) -> str:
    """Return a path in the notation for users, without the size of its last array."""
    above = [f"{step.name}[{step.count}]" if step.count is not None else step.name for step in path[:-1]]
    return ".".join([*above, path[-1].name])


def _size(path: Path) -> str:
    return "" if path[-1].count is None else f"[{path[-1].count}]"


def _sources(type_: AcceleratorType, output: Frame) -> dict[Path, str]:
    """Return, for each path of an output, the first parameter with an equal part, if any."""
    pairs = [*zip(parameter_names(type_), type_.inputs, strict=True)]
    return {path: name for name, side in reversed(pairs) for path in equal_paths(side.frame, output)}


def copied_fields(frame: Frame, sources: Mapping[Path, str]) -> list[Context]:
    """Return an expression for each used field: a copy from the variable in `sources`, or the default."""
    message = decode(frame, encode_used(with_names_in_use(frame, ()), {}))
    found = {names_of(path): sources.get(path) for path in top_paths(frame)}
    return [
        {"field": name, "value": _copied(value, (name,), found, f"[{python_string(name)}]")}
        for name, value in used_part(message, frame).items()
    ]


def _copied(value: Any, names: tuple[str, ...], sources: Mapping[tuple[str, ...], str | None], place: str) -> str:
    """Return a copy of `place` in the source of the field with these names, or the default without a source."""
    below = {source for path, source in sources.items() if path[: len(names)] == names}
    if below == {None} or not below:
        return _literal(value)
    if len(below) == 1:
        return f"{below.pop()}{place}"
    if isinstance(value, Mapping):
        inner = (
            f"{python_string(name)}: {_copied(item, (*names, name), sources, f'{place}[{python_string(name)}]')}"
            for name, item in value.items()
        )
        return f"{{{', '.join(inner)}}}"
    return f"[{', '.join(_copied(item, names, sources, f'{place}[{n}]') for n, item in enumerate(value))}]"


def _literal(value: Any) -> str:
    """Return a value as a Python literal."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{python_string(name)}: {_literal(inner)}' for name, inner in value.items())}}}"
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        same = len(value) > 1 and all(inner == value[0] for inner in value)
        if same and not isinstance(value[0], Mapping | list):
            return f"[{_literal(value[0])}] * {len(value)}"
        return f"[{', '.join(map(_literal, value))}]"
    if isinstance(value, str):
        return python_string(value)
    is_finite = not isinstance(value, float) or math.isfinite(value)
    return repr(value) if is_finite else f'float("{value}")'
