"""A third middleware is a module and a line that registers it: from definitions to simulated converters and systems."""

from __future__ import annotations

import importlib
import random
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.constants import CONSTANTS_TEMPLATE, constants_configuration
from fusesoc_firm.converter.sources import publisher_source, subscriber_source
from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import middleware
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.middleware import MIDDLEWARES
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.verify.loop import PUBLISHER_ID, SUBSCRIBER_ID, loop_text
from fusesoc_firm.runs.verify.simulation import firm_library, simulate, write_frames
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.render import render
from tests.frame.oracle import is_same
from tests.seeds import seeded

SEED = seeded(20241123)
PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "add-a-middleware.md"
MODULE = Path(__file__).parent / "parcel.py"
POSE, SCAN = MessageName("lab", "Pose"), MessageName("lab", "Scan")
DEFINITIONS = {
    "Place.parcel": "x: f64\ny: f64\n",
    "Pose.parcel": "# Of fixed size.\nid: u16\nis_valid: flag\nplace: Place\nlevels: 3 f32\nat: stamp\n",
    "Scan.parcel": "kind: u8\nnote: text\nplaces: any lab/Place\nsamples: any i16  # as they come\n",
}


@pytest.fixture
def parcel(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The module, registered until the test ends."""
    monkeypatch.setattr(middleware, "_registered", dict(middleware._registered))
    words = dict(MIDDLEWARES)
    module = importlib.import_module("tests.middleware.parcel")
    middleware.register(module.MIDDLEWARE)
    yield module
    MIDDLEWARES.clear()
    MIDDLEWARES.update(words)
    del sys.modules[module.__name__]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with the definitions."""
    folder = tmp_path / "lab"
    folder.mkdir()
    for name, text in DEFINITIONS.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def value_of(message: MessageName, chance: random.Random) -> dict[str, Any]:
    def place() -> dict[str, float]:
        return {"x": chance.uniform(-1, 1), "y": chance.uniform(-1, 1)}

    if message == POSE:
        levels = [float(chance.randrange(-1000, 1000)) for _ in range(3)]
        at = {"seconds": chance.randrange(2**32), "ticks": chance.randrange(2**16)}
        is_valid = chance.random() < 0.5
        return {"id": chance.randrange(2**16), "is_valid": is_valid, "place": place(), "levels": levels, "at": at}
    return {
        "kind": chance.randrange(256),
        "note": "".join(chance.choices("abcé ", k=chance.randrange(6))),
        "places": [place() for _ in range(chance.randrange(3))],
        "samples": [chance.randrange(-(2**15), 2**15) for _ in range(chance.randrange(5))],
    }


def packed(message: MessageName, value: dict[str, Any]) -> bytes:
    """The payload by hand: all has an even place but what follows a flag, a u8 or a text of odd length."""
    if message == POSE:
        place, at = value["place"], value["at"]
        numbers = (value["id"], value["is_valid"], place["x"], place["y"], *value["levels"], at["seconds"], at["ticks"])
        return b"\xca\xfe" + struct.pack("<H?xdd3fIH", *numbers)
    note = value["note"].encode()
    places = b"".join(struct.pack("<dd", place["x"], place["y"]) for place in value["places"])
    return b"".join(
        [
            b"\xca\xfe",
            struct.pack("<BxI", value["kind"], len(note)),
            note + bytes(len(note) % 2),
            struct.pack("<I", len(value["places"])) + places,
            struct.pack(f"<I{len(value['samples'])}h", len(value["samples"]), *value["samples"]),
        ]
    )


@pytest.mark.parametrize("message", [POSE, SCAN], ids=str)
def test_its_layout_and_codec(message: MessageName, parcel: ModuleType, package: Path) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    library = libraries([package], None, None)[parcel.MIDDLEWARE]
    frame = frame_of(message, library.closure(message))
    assert (frame.ros.title, frame.is_fixed_size) == ("Parcel", message == POSE)
    for _ in range(30):
        value = value_of(message, chance)
        assert encode(frame, value) == packed(message, value)
        assert is_same(decode(frame, packed(message, value)), value)


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("message", [POSE, SCAN], ids=str)
def test_its_converters_in_simulation(
    message: MessageName, width: int, parcel: ModuleType, package: Path, tmp_path: Path
) -> None:
    """What the host sends to the subscriber comes back from the publisher."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    definitions = MessageLibrary(parcel.MIDDLEWARE, [package]).closure(message)
    frame = frame_of(message, definitions)
    payloads = [packed(message, value_of(message, chance)) for _ in range(5)]
    write_frames(
        tmp_path,
        [pack_frame(SUBSCRIBER_ID, payload) for payload in payloads],
        [pack_frame(PUBLISHER_ID, payload) for payload in payloads],
    )
    outcome = simulate(tmp_path, write_sources(tmp_path, frame, width), firm_library(), SEED)
    assert outcome.is_right, outcome.output


def write_sources(folder: Path, frame: Frame, width: int) -> list[str]:
    texts = {
        subscriber_entity(frame): subscriber_source(frame, width).text,
        publisher_entity(frame): publisher_source(frame, width).text,
        "loop": loop_text(frame, width),
    }
    assert all("(Parcel)" in text for text in texts.values())
    for name, text in texts.items():
        (folder / f"{name}.vhd").write_text(text, encoding="latin-1")
    return [f"{name}.vhd" for name in texts]


def test_its_signature(parcel: ModuleType, package: Path) -> None:
    definitions = MessageLibrary(parcel.MIDDLEWARE, [package]).closure(POSE)
    assert signature(POSE, definitions) == parcel.checksum(POSE, definitions)
    text = render(CONSTANTS_TEMPLATE, constants_configuration(POSE, definitions, "lab_pose_pkg"))
    assert f'"{parcel.checksum(POSE, definitions)}"' in text


def test_its_faults_and_its_places(parcel: ModuleType, package: Path) -> None:
    (package / "Bad.parcel").write_text("id u16\nlevel: f33\nsome: -1 u8\n", encoding="utf-8")
    library = MessageLibrary(parcel.MIDDLEWARE, (), {"PARCEL_HOME": str(package)})
    with pytest.raises(InputError) as raised:
        library.get(MessageName("lab", "Bad"))
    places = [(fault.source.line, fault.message) for fault in raised.value.diagnostics if fault.source]
    assert places == [(1, "this is no field"), (2, "unknown type 'f33'"), (3, "'-1' is no count")]
    with pytest.raises(InputError, match="unknown message 'lab/Posse'"):
        library.get(MessageName("lab", "Posse"))


def test_a_system_speaks_it(package: Path) -> None:
    """In a process of its own, in which it is registered before anything else: as a line of the package would."""
    specification = package.parent / "system.yaml"
    specification.write_text(
        "project: {name: lab}\n"
        "blocks:\n"
        "  - {name: sub, middleware: PARCEL, mode: subscriber, message: lab/Scan, outgoing: [{name: pub}]}\n"
        "  - {name: pub, middleware: PARCEL, mode: publisher, message: lab/Scan}\n",
        encoding="utf-8",
    )
    program = (
        "from fusesoc_firm.message.middleware import register\n"
        "from tests.middleware import parcel\n"
        "register(parcel.MIDDLEWARE)\n"
        "from fusesoc_firm.cli import main\n"
        f"raise SystemExit(main(['system', 'check', {str(specification)!r}, '--path', {str(package)!r}]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=PAGE.parents[2]
    )
    assert "lab is valid: 1 subscriber, 0 accelerators, 1 publisher\n" in done.stdout, done.stderr


def test_the_page_shows_the_module_as_it_is() -> None:
    """Every line of the page's Python that is no comment stands in the module or in the package, in this order."""
    blocks = [part.partition("```")[0] for part in PAGE.read_text(encoding="utf-8").split("```python\n")[1:]]
    shown, line = "".join(blocks[:-1]), blocks[-1]
    written = iter(MODULE.read_text(encoding="utf-8").splitlines())
    missing = [text for text in shown.splitlines() if text.strip() not in ("", "...") and text not in written]
    assert shown
    assert not missing
    assert line.strip().splitlines()[-1] == "register(parcel.MIDDLEWARE)"
