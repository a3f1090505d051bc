"""FIRM's configuration file: the messages of a project and the names of their interfaces (dissertation, listing 5.1).

This module is the single source of the file's grammar. An interface is a converter under a user-chosen name.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.message.middleware import MIDDLEWARES
from fusesoc_firm.text.diagnostics import Diagnostics, fail
from fusesoc_firm.text.naming import PREFIX_RULE, identifier, is_prefix
from fusesoc_firm.text.yaml_sections import Section, key, read
from fusesoc_firm.text.yaml_text import Text, is_null, read_yaml


@dataclass(frozen=True)
class Platform(Section):
    """The target platform; it does not affect the converters."""

    board: Text | None = key("the board's name")
    fpga_part: Text | None = key("the FPGA's part number", name="FPGA", aliases=("fpgaPart",))


@dataclass(frozen=True)
class Project(Section):
    """The settings that apply to all messages."""

    name: Text = key("the project's name", is_required=True)
    platform: Platform | None = key("the target hardware", form="section", section=Platform)
    width: int = key("width in bits of the streams", form="integer", choices=WIDTHS, default=8)
    prefix: Text | None = key("prefix for the names of all generated units except the interfaces, such as left")


@dataclass(frozen=True)
class MessageInterfaces(Section):
    """A message and its requested converters."""

    type: Text = key("the middleware that defines the message", is_required=True, choices=tuple(MIDDLEWARES))
    name: Text = key("the message's type, such as sensor_msgs/Image", is_required=True)
    subscribers: tuple[Text, ...] = key("names of converters from frames to the message", form="texts")
    publishers: tuple[Text, ...] = key("names of converters from the message to frames", form="texts")


@dataclass(frozen=True)
class ConfigFile(Section):
    """The contents of a configuration file."""

    project: Project = key("settings of all messages", form="section", section=Project, is_required=True)
    messages: tuple[MessageInterfaces, ...] = key(
        "the messages and their interfaces", form="sections", section=MessageInterfaces, is_required=True
    )


def read_config(path: Path, faults: Diagnostics) -> ConfigFile:
    """Read a configuration file and note all faults in the file.

    Raise `InputError` if the file cannot be read, is empty, or is not YAML from the start.
    """
    text = read_yaml(path, str(path), faults)
    if text.root is None or is_null(text.root):
        faults.raise_if_any()
        fail(f"{path} is empty; a configuration needs the keys 'project' and 'messages'")
    config = read(ConfigFile, text.root, text, faults, "a configuration")
    _check_names(config, faults)
    return config


def _check_names(config: ConfigFile, faults: Diagnostics) -> None:
    """Check that each message has an interface, and that each interface has a unique, legal entity name."""
    prefix = config.project.prefix
    if prefix is not None and not is_prefix(prefix):
        faults.error(f"'{prefix}_axis_to_...' is not a legal entity name", prefix.source, PREFIX_RULE)
    seen: dict[str, Text] = {}
    for message in config.messages:
        names = (*message.subscribers, *message.publishers)
        if not names and message.is_sound:
            hint = "add 'subscribers', 'publishers' or both"
            faults.error(f"'{message.name}' has no interface", message.name.source, hint)
        for name in names:
            if identifier(name) != name:
                hint = "legal here: letters, digits and single '_' between them, except VHDL and Verilog keywords"
                faults.error(f"'{name}' is not a legal entity name", name.source, hint)
            first = seen.setdefault(name.lower(), name)
            if first is not name:
                faults.error(f"duplicate interface '{name}'; the first is at {first.source}", name.source)
