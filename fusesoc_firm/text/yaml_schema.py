"""Describe the grammar of a YAML file as a JSON Schema, with which editors check and complete the file.

The schema covers the same rules as the file's sections (`yaml_sections`). Only reading the file detects unknown names.
"""

from __future__ import annotations

from typing import Any

from fusesoc_firm.text.yaml_sections import Key, Section, keys_of

Schema = dict[str, Any]

# YAML may parse words as numbers.
_WORD = {"type": ["string", "number", "boolean"]}


def json_schema(section: type[Section], title: str) -> Schema:
    """Return the schema, in JSON Schema draft 2020-12, of a file whose content is one section."""
    definitions: dict[str, Schema] = {}
    _define(section, definitions)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "$ref": _reference(section),
        "$defs": dict(sorted(definitions.items())),
    }


def _reference(section: type[Section]) -> str:
    return f"#/$defs/{section.__name__}"


def _define(section: type[Section], definitions: dict[str, Schema]) -> None:
    """Add the schemas of a section and all sections within it."""
    if section.__name__ in definitions:
        return
    definition: Schema = {"type": "object", "additionalProperties": False, "properties": {}}
    definitions[section.__name__] = definition
    for name, (_, entry) in keys_of(section).items():
        if entry.section:
            _define(entry.section, definitions)
        for spelling in (name, *entry.aliases):
            definition["properties"][spelling] = _property(entry)
    if needed := [_spelt(name, entry) for name, (_, entry) in keys_of(section).items() if entry.is_required]:
        definition["allOf"] = needed


def _spelt(name: str, entry: Key) -> Schema:
    """Return a schema that requires the key in exactly one of its spellings."""
    ways = [{"required": [spelling]} for spelling in (name, *entry.aliases)]
    found = ways[0] if len(ways) == 1 else {"oneOf": ways}
    if entry.unless is None:
        return found
    other, value = entry.unless
    return {"anyOf": [{"properties": {other: {"const": value}}, "required": [other]}, found]}


def _property(entry: Key) -> Schema:
    """Return the schema of a key's value; the value may be null unless the key is required."""
    value = _value(entry)
    legal = value if entry.is_required else {"anyOf": [value, {"type": "null"}]}
    return {"description": entry.meaning, **legal}


def _value(entry: Key) -> Schema:
    match entry.form:
        case "section":
            assert entry.section
            return {"$ref": _reference(entry.section)}
        case "sections":
            assert entry.section
            return {"type": "array", "items": {"$ref": _reference(entry.section)}}
        case "texts":
            return {"anyOf": [_WORD, {"type": "array", "minItems": 1, "items": _WORD}]}
        case _ if entry.choices:
            return {"enum": [*entry.choices]}
        case "integer":
            return {"type": "integer"}
        case _:
            return _WORD
