"""The parameters of a node in ROS, which have the effect of options of its command line.

    option_words(parameters_of([1], "robot", arguments, print))     # ["--queue", "20"] of a parameter `queue`

ROS 1 keeps parameters in its master; a launch file or `_NAME:=VALUE` on the command line sets them. ROS 2 passes them
on the command line, one by one or in files.
"""

from __future__ import annotations

import http.client
import os
import re
import time
import xmlrpc.client
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.node.interface.options import ROS_ARGUMENTS
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.yaml_text import data_in, yaml_data

# The parameters, by their names; `-` in an option is `_`.
PARAMETERS = ("transport", "status", "qos", "queue", "overflow", "drain", "restart", "trace", "lifecycle", "ros_python")
_SWITCHES = ("restart", "lifecycle")
_MASTER = "http://localhost:11311"
_MASTER_SECONDS = 5.0
_AGAIN_SECONDS = 0.1
_NODE_NAMES = ("__node", "__name")

Parameters = dict[str, Any]


def parameters_of(
    versions: Sequence[int],
    name: str,
    arguments: Sequence[str],
    report: Callable[[str], None],
    known: Collection[str] = PARAMETERS,
) -> Parameters:
    """Return the parameters of the node called `name` that are `known` and set, with `arguments` to ROS.

    The parts of a name are separated by dots, in ROS 1 also by slashes.
    With ROS 1, wait for the master; and call `report` once. Raise `InputError` for an invalid argument or file.
    """
    found: Parameters = {}
    if 1 in versions:
        found |= _of_master(name, arguments, report)
    if 2 in versions:
        found |= _of_arguments(name, arguments)
    return {key: value for key, value in _flat(found) if key in known}


def _flat(values: Parameters, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested mappings with their full names."""
    for key, value in values.items():
        name = f"{above}{str(key).replace('/', '.')}"
        if isinstance(value, dict):
            yield from _flat(value, f"{name}.")
        else:
            yield name, value


def option_words(parameters: Parameters) -> list[str]:
    """Return the options that correspond to parameters. May raise `InputError`."""
    words = []
    for name, value in parameters.items():
        option = f"--{name.replace('_', '-')}"
        if name in _SWITCHES:
            if not isinstance(value, bool):
                fail(f"the parameter '{name}' is '{value}'", hint="legal: true, false")
            words += [option] if value else []
        else:
            # One word, since the value may begin with a hyphen.
            words.append(f"{option}={value}")
    return words


def _of_master(name: str, arguments: Sequence[str], report: Callable[[str], None]) -> Parameters:
    """Return the private parameters of a node of ROS 1."""
    assigned = dict(_assignments(arguments))
    space = assigned.get("__ns", os.environ.get("ROS_NAMESPACE", "")).strip("/")
    node = "/".join(["", *filter(None, [space, assigned.get("__name", name).strip("/")])])
    values = _tree(assigned.get("__master", os.environ.get("ROS_MASTER_URI", _MASTER)), node, report)
    given = {key[1:]: _value(text) for key, text in assigned.items() if key[:1] == "_" and key[1:2] != "_"}
    return values | given


def _tree(uri: str, node: str, report: Callable[[str], None]) -> Parameters:
    """Return all private parameters of a node in the master."""
    master = xmlrpc.client.ServerProxy(uri, transport=_Transport())
    is_told = False
    while True:
        try:
            status, _, values = _answer(master.getParam(node, node))
            return values if status == 1 and isinstance(values, dict) else {}
        except (OSError, http.client.HTTPException, xmlrpc.client.Error):
            if not is_told:
                report(f"waiting for a master at {uri}")
            is_told = True
            time.sleep(_AGAIN_SECONDS)


class _Transport(xmlrpc.client.Transport):
    """A connection to a master that does not wait without a limit."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Return a new connection."""
        return http.client.HTTPConnection(host, timeout=_MASTER_SECONDS)


def _answer(answer: Any) -> tuple[int, str, Any]:
    if not isinstance(answer, list | tuple) or len(answer) != 3:
        fail("the master of ROS 1 gave an answer that is none")
    status, text, value = answer
    return status, text, value


def _of_arguments(name: str, arguments: Sequence[str]) -> Parameters:
    """Return the parameters of a node of ROS 2, in the order in which they are set."""
    words = list(_ros_words(arguments))
    assigned = dict(_assignments(arguments))
    node = next((assigned[key] for key in _NODE_NAMES if key in assigned), name)
    space = assigned.get("__ns", "").strip("/")
    full_name = "/".join(["", *filter(None, [space, node])])
    found: Parameters = {}
    for option, value in pairwise(words):
        if option == "--params-file":
            found |= _of_file(Path(value), full_name)
        elif option in ("-p", "--param"):
            target, separator, text = value.partition(":=")
            if not separator:
                fail(f"'{option} {value}' is not a parameter", hint="legal: NAME:=VALUE")
            of_node, _, key = target.rpartition(":")
            if not of_node or _is_meant(of_node, full_name):
                found[key] = _value(text)
    return found


def _of_file(path: Path, node: str) -> Parameters:
    """Return the parameters that a file of ROS 2 sets for a node."""
    try:
        content = data_in(path)
    except (OSError, UnicodeDecodeError) as error:
        fail(f"cannot read '{path}': {error}")
    except yaml.YAMLError as error:
        fail(f"{path} is not YAML: {error}")
    found: Parameters = {}
    for pattern, values in _sections(content):
        if _is_meant(pattern, node):
            found |= values
    return found


def _sections(content: Any, above: str = "") -> Iterator[tuple[str, Parameters]]:
    """Yield the names of nodes in a parameter file, which may be nested, and their parameters."""
    if not isinstance(content, dict):
        return
    for name, inner in content.items():
        if name == "ros__parameters":
            if isinstance(inner, dict):
                yield above, inner
        else:
            yield from _sections(inner, f"{above}/{str(name).strip('/')}")


def _is_meant(pattern: str, node: str) -> bool:
    """Return whether a pattern names a node: `*` matches a part of a name, `**` any number of parts."""
    parts = re.split(r"(/\*\*|\*)", f"/{pattern.strip('/')}")
    expression = {"/**": r"(/\w+)*", "*": r"\w+"}
    return bool(re.fullmatch("".join(expression.get(part, re.escape(part)) for part in parts), node))


def _assignments(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield all words NAME:=VALUE except parameters of ROS 2."""
    before = ""
    for word in arguments:
        name, separator, value = word.partition(":=")
        if separator and before not in ("-p", "--param"):
            yield name, value
        before = word


def _ros_words(arguments: Sequence[str]) -> Iterator[str]:
    """Yield the words for ROS 2."""
    words = iter(arguments)
    for word in words:
        if word == ROS_ARGUMENTS:
            yield from words


def _value(text: str) -> Any:
    """Return the value of a parameter on a command line, which is YAML."""
    try:
        value = yaml_data(text)
    except yaml.YAMLError:
        return text
    return value if isinstance(value, bool | int | float) else text
