"""Edits of a specification according to its grammar; each changes as little of the file as possible.

An edit addresses a section by the keys and indices that lead to it, such as `["blocks", 2, "outgoing", 0]`. The check
of the specification determines whether the result is valid, as after an edit by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import yaml

from fusesoc_firm.system.written.specification import Specification
from fusesoc_firm.text.yaml_edit import EditError, Path, insert, put, remove, value_at
from fusesoc_firm.text.yaml_sections import Key, Section, keys_of
from fusesoc_firm.text.yaml_text import yaml_data


def edited(text: str, edit: Mapping[str, Any]) -> str:
    """Return the text of a specification after an edit.

    The key `edit` names the kind: `set` (the key of the section at `path` receives `value`, or is removed without one),
    `add` (an item to the list at `path`, at its end or at `index`), `remove` (the item at `path` and all references to
    it), `rename` (the item at `path` and all references to it), `connect` and `disconnect` (blocks `source` and
    `sink`). Raise `EditError` with the reason for an impossible edit.
    """
    kind = edit.get("edit")
    if not isinstance(kind, str) or kind not in _EDITS:
        raise EditError(f"there is no edit '{kind}'; legal here: {', '.join(_EDITS)}")
    if missing := [name for name in _NEEDED[kind] if name not in edit]:
        raise EditError(f"the edit '{kind}' needs '{missing[0]}'")
    try:
        return _EDITS[kind](text, edit)
    except yaml.YAMLError as error:
        raise EditError(f"invalid YAML: {error}") from error


def section_at(path: Path) -> type[Section]:
    """Return the grammar of the section at a path. Raise `EditError` if the path cannot lead to a section."""
    section: type[Section] = Specification
    steps = iter(path)
    for step in steps:
        entry = _key(section, step)
        if entry.form == "sections":
            index = next(steps, None)
            if not isinstance(index, int) or index < 0:
                raise EditError(f"'{step}' is a list, so its items have a number")
        elif entry.form != "section":
            raise EditError(f"'{step}' is not a section")
        assert entry.section
        section = entry.section
    return section


def _key(section: type[Section], name: object) -> Key:
    known = keys_of(section)
    if not isinstance(name, str) or name not in known:
        raise EditError(f"there is no key '{name}' here; legal here: {', '.join(known)}")
    return known[name][1]


def _set(text: str, edit: Mapping[str, Any]) -> str:
    path, name, value = _path(edit["path"]), edit["key"], edit.get("value")
    section = section_at(path)
    entry = _key(section, name)
    there = value_at(yaml_data(text), path)
    # The author may use another spelling of the key.
    name = next((spelling for spelling in entry.aliases if spelling in there), name)
    if value is None or value in ("", []):
        return remove(text, [*path, name]) if name in there else text
    if entry.section:
        raise EditError(f"'{name}' consists of sections; 'add' adds one")
    return put(text, [*path, name], _value(entry, value, there.get(name)), [*keys_of(section)])


def _value(entry: Key, value: Any, old: Any) -> Any:
    """Return a value in the file's form: a list with a single text may have no brackets."""
    if entry.form != "texts":
        if isinstance(value, list | dict):
            raise EditError("the value must be a word")
        return value
    values = [value] if isinstance(value, str) else value
    if not isinstance(values, list) or not all(isinstance(item, str | int) for item in values):
        raise EditError("the value must be a list of words")
    return values[0] if len(values) == 1 and old is not None and not isinstance(old, list) else values


def _add(text: str, edit: Mapping[str, Any]) -> str:
    path, value = _path(edit["path"]), edit["value"]
    if not path or not isinstance(path[-1], str):
        raise EditError("'add' needs the path of a list")
    section = section_at(path[:-1])
    entry = _key(section, path[-1])
    if entry.form != "sections" or not isinstance(value, Mapping) or not value:
        raise EditError(f"'{path[-1]}' takes no item of this kind")
    assert entry.section
    for name in value:
        _key(entry.section, name)
    items = value_at(yaml_data(text), path[:-1]).get(path[-1])
    if not items:
        return put(text, path, [value], [*keys_of(section)])
    index = edit.get("index", len(items))
    if not isinstance(index, int) or not 0 <= index <= len(items):
        raise EditError(f"the list at '{path[-1]}' has {len(items)} items")
    return insert(text, path, index, value)


def _remove(text: str, edit: Mapping[str, Any]) -> str:
    path = _path(edit["path"])
    if not path or not isinstance(path[-1], int):
        raise EditError("'remove' needs the path of a list's item")
    section_at(path)
    name = value_at(yaml_data(text), path).get("name")
    text = _without(text, path)
    if len(path) == 2 and path[0] == "blocks":
        # From the end, so that the other places remain valid.
        for place in sorted(_references(text, path, name), key=_order, reverse=True):
            text = remove(text, place) if place[-1] == "publishers" else _without(text, _item(place))
    return text


def _without(text: str, path: Path) -> str:
    """Return the text without an item, and without the key of an optional list that becomes empty."""
    siblings = value_at(yaml_data(text), path[:-1])
    parent = path[:-2]
    is_optional = len(path) > 1 and not _key(section_at(parent), path[-2]).is_required
    return remove(text, path[:-1] if is_optional and len(siblings) == 1 else path)


def _rename(text: str, edit: Mapping[str, Any]) -> str:
    path, new = _path(edit["path"]), str(edit["name"])
    section_at(path)
    old = value_at(yaml_data(text), path).get("name")
    for place in [[*path, "name"], *_references(text, path, old)]:
        text = put(text, place, new)
    return text


def _references(text: str, path: Path, name: object) -> Iterator[Path]:
    """Yield the places that refer to the named item at a path."""
    data = yaml_data(text)
    blocks = [(number, block) for number, block in enumerate(_list(data, "blocks")) if isinstance(block, dict)]
    match path:
        case ["blocks", _]:
            for number, block in blocks:
                for way in _named(_list(block, "outgoing"), name):
                    yield "blocks", number, "outgoing", *way
            for number, group in enumerate(_list(data.get("project"), "groups")):
                for member in _members(group, name):
                    yield "project", "groups", number, *member
        case ["accelerators", _]:
            yield from (("blocks", number, "type") for number, block in blocks if _is(block.get("type"), name))
        case ["project", "clocks", _]:
            yield from (("blocks", number, "clock") for number, block in blocks if _is(block.get("clock"), name))


def _named(items: Sequence[Any], name: object) -> Iterator[Path]:
    """Yield the places of a name among the items of a list."""
    for number, item in enumerate(items):
        if isinstance(item, dict) and _is(item.get("name"), name):
            yield [number, "name"]


def _members(group: Any, name: object) -> Iterator[Path]:
    """Yield the places of a publisher in a group; a single publisher may have no brackets."""
    if isinstance(group, dict) and _is(group.get("publishers"), name):
        yield ["publishers"]
    for number, item in enumerate(_list(group, "publishers")):
        if _is(item, name):
            yield ["publishers", number]


def _connect(text: str, edit: Mapping[str, Any]) -> str:
    sink = str(edit["sink"])
    _block(text, sink)
    return _add(text, {"path": ["blocks", _block(text, str(edit["source"])), "outgoing"], "value": {"name": sink}})


def _disconnect(text: str, edit: Mapping[str, Any]) -> str:
    source = _block(text, str(edit["source"]))
    ways = _list(yaml_data(text)["blocks"][source], "outgoing")
    found = [place for place, way in enumerate(ways) if isinstance(way, dict) and _is(way.get("name"), edit["sink"])]
    if not found:
        raise EditError(f"'{edit['source']}' is not connected to '{edit['sink']}'")
    return _without(text, ["blocks", source, "outgoing", found[0]])


def _block(text: str, name: str) -> int:
    """Return the index of a block."""
    blocks = _list(yaml_data(text), "blocks")
    for number, block in enumerate(blocks):
        if isinstance(block, dict) and _is(block.get("name"), name):
            return number
    raise EditError(f"there is no block '{name}'")


def _item(place: Path) -> Path:
    """Return the place of the list's item that refers to another one."""
    return place[:-1] if place[-1] == "name" else place


def _is(found: object, name: object) -> bool:
    """Whether two names are equal; YAML may read a name as a number."""
    return found is not None and str(found) == str(name)


def _path(path: object) -> list[str | int]:
    if not isinstance(path, list) or not all(isinstance(part, str | int) for part in path):
        raise EditError("a path is a list of keys and numbers")
    return path


def _list(data: Any, name: str) -> list[Any]:
    found = data.get(name) if isinstance(data, dict) else None
    return found if isinstance(found, list) else []


def _order(place: Path) -> tuple[tuple[str, int], ...]:
    return tuple((part, 0) if isinstance(part, str) else ("", part) for part in place)


_EDITS: dict[str, Callable[[str, Mapping[str, Any]], str]] = {
    "set": _set,
    "add": _add,
    "remove": _remove,
    "rename": _rename,
    "connect": _connect,
    "disconnect": _disconnect,
}
_NEEDED = {
    "set": ("path", "key"),
    "add": ("path", "value"),
    "remove": ("path",),
    "rename": ("path", "name"),
    "connect": ("source", "sink"),
    "disconnect": ("source", "sink"),
}
