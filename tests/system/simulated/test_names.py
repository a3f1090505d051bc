"""A block and a pin may together have the name of anything in the top level."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from itertools import pairwise
from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.scaffold.skeleton import missing_sources
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.naming import KEYWORDS
from tests.hdl.ghdl import Library, core_files
from tests.system.simulated.systems import RUNTIME, generate_system

HOSTS = {
    "streams": "  status: axi_lite\n",
    "uart": "  interconnect: uart\n  status: frames\n",
    "spi": "  interconnect: spi\n",
    "w5500": "  interconnect: w5500\n  network: {mac: 02:00:00:00:00:01, address: 10.0.0.2, master: 10.0.0.1}\n",
    "rgmii": "  interconnect: ethernet\n  network: {phy: rgmii, mac: 02:00:00:00:00:01, address: 10.0.0.2}\n",
}
_DECLARED = re.compile(r"^(?:    (?=\w+ *: (?:in|out) )|  signal )(\w+)", re.MULTILINE)
_NAME = re.compile(r"([a-z][a-z0-9]*)_([a-z][a-z0-9]*(?:_[a-z0-9]+)*)")
_ACCELERATOR = """\
  - name: type_{name}
    type: VHDL
    sources: type_{name}.vhd
    interface:
      input: [{{middleware: {middleware}, message: std_msgs/Bool}}]
      output: [{{middleware: {middleware}, message: std_msgs/Bool}}]
    pins: [{pins}]
"""


def specification(host: str, pins: dict[str, list[str]]) -> str:
    """A system with a block for each key, which has these pins; a message passes all blocks."""
    middleware = "ROS2" if host == "rgmii" else "ROS"
    text = f"project:\n  name: named\n  clock: 125 MHz\n  width: 32\n{HOSTS[host]}accelerators:\n"
    for name, found in pins.items():
        listed = ", ".join(f"{{name: {pin}, direction: in}}" for pin in found)
        text += _ACCELERATOR.format(name=name, middleware=middleware, pins=listed)
    end = f"middleware: {middleware}, message: std_msgs/Bool"
    names = [*pins]
    text += f"blocks:\n  - {{name: a_in, {end}, mode: subscriber, outgoing: [{{name: {names[0]}}}]}}\n"
    for name, after in pairwise([*names, "a_out"]):
        text += f"  - {{name: {name}, type: type_{name}, outgoing: [{{name: {after}}}]}}\n"
    return f"{text}  - {{name: a_out, {end}, mode: publisher}}\n"


def generated(text: str, folder: Path) -> list[str]:
    """The top level and its test bench."""
    folder.mkdir()
    spec = folder / "named.yaml"
    spec.write_text(text, encoding="utf-8")
    system = load_system(spec, {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}, needs_sources=False).system
    for path, source in missing_sources(system, folder).items():
        path.write_text(source, encoding="utf-8")
    files = generate_system(spec, folder / "core")
    if not system.network:
        Library("firm", folder).analyse(core_files(*RUNTIME))
        work = Library("work", folder)
        work.analyse(files)
        work.make()
    return [path.read_text(encoding="utf-8") for path in files if path.stem.startswith(system.entity)]


@pytest.mark.parametrize("host", HOSTS)
def test_every_word_of_the_top_level_can_be_the_name_of_a_pin(host: str, tmp_path: Path) -> None:
    text = "".join(generated(specification(host, {"a": ["b"]}), tmp_path / "first"))
    pins: defaultdict[str, list[str]] = defaultdict(list)
    for word in sorted({*re.findall(r"\w+", re.sub("--.*", "", text.lower()))}):
        found = _NAME.fullmatch(word)
        if found and found[1] not in (*KEYWORDS, "a", "type") and found[2] not in (*KEYWORDS, "rst_n"):
            pins[found[1]].append(found[2])
    assert sum(map(len, pins.values())) > 50
    for file in generated(specification(host, pins), tmp_path / "second"):
        names = Counter(map(str.lower, _DECLARED.findall(file)))
        assert not [name for name, count in names.items() if count > 1]
