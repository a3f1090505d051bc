"""The ids of frames: the key `idBytes` of the specification."""

from __future__ import annotations

from collections.abc import Sequence

from fusesoc_firm.system.written.specification import Block
from fusesoc_firm.text.diagnostics import Diagnostics

ONE_BYTE, TWO_BYTES = 1, 2


def check_count(whole: str, mode: str, found: Sequence[Block], id_bytes: int, faults: Diagnostics) -> None:
    """Note a fault if the `whole` has more converters of a mode than ids."""
    most = 2 ** (8 * id_bytes)
    if len(found) > most:
        size = "one byte" if id_bytes == ONE_BYTE else "two bytes"
        faults.error(
            f"the {whole} has {len(found)} {mode}s; ids are {size} long, so the limit is {most}",
            found[most].name.source,
            f"add 'idBytes: {TWO_BYTES}' to 'project'" if id_bytes == ONE_BYTE else "",
        )
