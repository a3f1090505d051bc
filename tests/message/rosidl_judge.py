"""What rosidl reads in `.idl` texts; runs with the Python of ROS 2: a list of texts in JSON, and of results.

The result of a text is a list of its messages: the name, the fields with their types and default values, the constants
and, if no field has a message's type, the hash.
"""

import contextlib
import json
import sys

from rosidl_generator_type_description import calculate_type_hash, serialize_individual_type_description
from rosidl_parser import definition as rosidl
from rosidl_parser.parser import parse_idl_string

WORDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}


def type_of(kind: rosidl.AbstractType) -> str:
    """The type as a `.msg` file spells it."""
    match kind:
        case rosidl.Array():
            return f"{type_of(kind.value_type)}[{kind.size}]"
        case rosidl.BoundedSequence():
            return f"{type_of(kind.value_type)}[<={kind.maximum_size}]"
        case rosidl.UnboundedSequence():
            return f"{type_of(kind.value_type)}[]"
        case rosidl.AbstractGenericString():
            word = "wstring" if isinstance(kind, rosidl.AbstractWString) else "string"
            return f"{word}<={kind.maximum_size}" if kind.has_maximum_size() else word
        case rosidl.NamespacedType():
            return f"{kind.namespaces[0]}/{kind.name}"
    return WORDS.get(kind.typename, str(kind.typename))


def default_of(member: rosidl.Member) -> object:
    """The default value, if any."""
    return member.get_annotation_value("default")["value"] if member.has_annotation("default") else None


def described(message: rosidl.Message) -> dict[str, object]:
    """What a message consists of."""
    structure = message.structure
    description = serialize_individual_type_description(structure.namespaced_type, structure.members)
    is_flat = not any(field["type"]["nested_type_name"] for field in description["fields"])
    whole = {"type_description": description, "referenced_type_descriptions": []}
    return {
        "name": "/".join(structure.namespaced_type.namespaced_name()),
        "fields": [[member.name, type_of(member.type), default_of(member)] for member in structure.members],
        "constants": [[constant.name, constant.value] for constant in message.constants],
        "hash": calculate_type_hash(whole) if is_flat else "",
    }


def messages(text: str) -> list[dict[str, object]]:
    """The messages that a text defines."""
    with contextlib.redirect_stdout(sys.stderr):
        elements = parse_idl_string(text).elements
    found = []
    for element in elements:
        match element:
            case rosidl.Message():
                found.append(element)
            case rosidl.Service():
                found += [element.request_message, element.response_message]
            case rosidl.Action():
                found += [element.goal, element.result, element.feedback]
    return [described(message) for message in found]


if __name__ == "__main__":
    json.dump([messages(text) for text in json.load(sys.stdin)], sys.stdout)
