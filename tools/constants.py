"""`make constants`: writes the constants of C, C++ and VHDL that are also those of Python."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path

from fusesoc_firm.fabric import control, packets, rtps
from fusesoc_firm.frame.faults import Fault
from tests.hdl.ghdl import CORES, REPOSITORY

C = REPOSITORY / "fusesoc_firm/node/c/firm/firm_faults.h"
CPP = REPOSITORY / "fusesoc_firm/node/cpp/firm/faults.hpp"
FAULTS = CORES / "axis/rtl/firm_fault_pkg.vhd"
RTPS = CORES / "net/rtl/firm_rtps_pkg.vhd"
PORTS = CORES / "net/rtl/firm_rtps_control.vhd"

_TEXTS = r'(?<="no fault",\n).*?(?=^};)', "".join(f'    "{fault.text}",\n' for fault in Fault)
_ENTITIES = {
    name: getattr(rtps, name) for name in ("PARTICIPANT_WRITER", "PUBLICATIONS_WRITER", "SUBSCRIPTIONS_WRITER")
}
_RTPS = {
    **rtps.Parameter.__members__,
    **rtps.Kind.__members__,
    **{name: int.from_bytes(entity) for name, entity in _ENTITIES.items()},
    "FRAGMENT_BYTES": packets.FRAGMENT_BYTES,
}
# `key` has more than one address, of which the hardware compares the upper half.
_PORTS = {name.upper(): address for name, address in control.PORTS.items() if name != "key"}


def files() -> dict[Path, str]:
    """The files with constants that are written in Python, too, and their texts."""
    c_codes = ",\n".join(f"    FIRM_FAULT_{fault.name} = {fault}" for fault in Fault)
    cpp_codes = "".join(f"  k{fault.name.title().replace('_', '')} = {fault},\n" for fault in Fault)
    vhdl_codes = "".join(
        f'  -- {fault.text}\n  constant {fault.name:12} : fault_t := "{fault:04b}";\n' for fault in Fault
    )
    return {
        C: _replaced(C, (r"(?<=enum {\n).*?(?=\n})", c_codes), _TEXTS),
        CPP: _replaced(CPP, (r"(?<=uint8_t {\n).*?(?=^};)", cpp_codes), _TEXTS),
        FAULTS: _replaced(FAULTS, (r'(?<=:= "0000";\n).*?(?=\nend)', vhdl_codes)),
        RTPS: _numbered(RTPS, "RTPS", _RTPS),
        PORTS: _numbered(PORTS, "AT", _PORTS),
    }


def _replaced(path: Path, *parts: tuple[str, str]) -> str:
    """The text of a file with another text for the match of each pattern."""
    text = path.read_text(encoding="ascii")
    for pattern, new in parts:
        text = re.sub(pattern, new, text, flags=re.DOTALL | re.MULTILINE)
    return text


def _numbered(path: Path, prefix: str, numbers: Mapping[str, int]) -> str:
    """The text of a package with the numbers of the constants whose names, after the prefix, are among `numbers`."""

    def constant(found: re.Match[str]) -> str:
        head, name, digits = found.groups()
        if name not in numbers:
            return found[0]
        return head + (f'x"{numbers[name]:0{len(digits)}x}"' if digits else str(numbers[name]))

    return re.sub(rf'(constant {prefix}_(\w+) .*:= )(?:x"(\w+)"|\d+)(?=;)', constant, path.read_text(encoding="ascii"))


if __name__ == "__main__":
    argparse.ArgumentParser(prog="make constants", description=__doc__).parse_args()
    for file, content in files().items():
        file.write_text(content, encoding="ascii")
