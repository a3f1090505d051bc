"""A rule of definitions is a field of the dialect: one that a middleware changes holds from its text to its bytes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1, dialect
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.diagnostics import InputError

FEW = MessageName("lab", "Few")
BOUNDED = replace(ROS1, number=3, title="Lab", dialect=replace(dialect.ROS1, title="Lab", has_bounds=True))


def test_a_dialect_with_another_rule(tmp_path: Path) -> None:
    folder = tmp_path / "lab"
    folder.mkdir()
    (folder / "Few.msg").write_text("uint16[<=3] data\n", encoding="utf-8")
    with pytest.raises(InputError, match="ROS 1 does not support bounds"):
        MessageLibrary(ROS1, [folder]).get(FEW)
    library = MessageLibrary(BOUNDED, [folder])
    assert str(library.get(FEW).fields[0].type) == "uint16[<=3]"
    assert encode(frame_of(FEW, library.closure(FEW)), {"data": [1, 2]}) == b"\x02\0\0\0\x01\0\x02\0"
