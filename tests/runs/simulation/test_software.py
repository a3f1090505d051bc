"""Software in the simulation of a system: what becomes stimuli, what is compared, and how its faults are shown."""

from __future__ import annotations

import struct
import sys
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.runs.simulation.host_files import software_text
from fusesoc_firm.runs.simulation.reference import responses
from fusesoc_firm.runs.simulation.software_run import Traffic, answered, stimulated, traffic
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import accelerator, converter, derived, instance, specification

Message = dict[str, Any]
HARD = accelerator("hard", "Point", "Point")
SAME = "def respond(block, m):\n    return [(name, m) for name in NAMES]\n"


def point(x: float) -> Message:
    return {"x": x, "y": 0.0, "z": 0.0}


def soft(folder: Path, name: str, code: str, inputs: str = "Point", outputs: str = "Point") -> str:
    """A line of `accelerators` whose source has this code."""
    (folder / f"{name}.py").write_text(code, encoding="utf-8")
    return accelerator(name, inputs, outputs, "ROS-SW", f"{name}.py")


def elsewhere(name: str, inputs: str = "Point", outputs: str = "Point") -> str:
    """A line of `accelerators` without sources."""
    return accelerator(name, inputs, outputs, "ROS-SW").replace("sources: [acc.vhd], ", "")


def run(folder: Path, system: DerivedSystem, model: str, *sent: tuple[str, Message]) -> Traffic:
    path = folder / "model.py"
    path.write_text(model, encoding="utf-8")
    topics = {topic.block: topic for topic in stimulated(system)}
    stimuli = [Stimulus(topics[block], encode(topics[block].frame, message), message) for block, message in sent]
    return traffic(system, folder, stimuli, responses(path, stimuli, answered(system)))


def shown(found: Traffic) -> tuple[list[tuple[str, float]], list[tuple[str, float, int | None]]]:
    """Blocks and their x, sent and expected; the latter with what caused them."""
    return (
        [(item.subscriber.block, item.message["x"]) for item in found.stimuli],
        [(item.publisher.block, item.message["x"], item.cause) for item in found.responses],
    )


def row(folder: Path, *kinds: str, code: str = "", model: str, sent: tuple[tuple[str, Message], ...]) -> Traffic:
    """The traffic of blocks `b0`, `b1`, ... between `sub` and `pub`; `soft` runs the code, which has its name."""
    names = [f"b{number}" for number in range(len(kinds))]
    blocks = converter("sub", "subscriber", "Point", names[0])
    blocks += "".join(instance(*item) for item in zip(names, kinds, [*names[1:], "pub"], strict=True))
    blocks += converter("pub", "publisher", "Point")
    types = HARD + (soft(folder, "soft", code) if code else elsewhere("soft"))
    return run(folder, derived(folder, specification(blocks, types)), model, *sent)


DOUBLE = "def soft(m):\n    return {**m, 'x': 2 * m['x']}\n"
TWO = (("sub", point(1.0)), ("sub", point(5.0)))


def test_what_software_sends_to_hardware_is_a_stimulus(tmp_path: Path) -> None:
    """It stands behind the one that led to it, and is what the answers of what is behind it are counted from."""
    model = "def respond(block, m):\n    return [('b1_in', {**m, 'x': m['x'] + 1}), ('pub', {**m, 'x': -m['x']})]\n"
    sent, expected = shown(row(tmp_path, "hard", "soft", "hard", code=DOUBLE, model=model, sent=TWO))
    assert sent == [("sub", 1.0), ("b1_out", 4.0), ("sub", 5.0), ("b1_out", 12.0)]
    assert expected == [("b1_in", 2.0, 0), ("pub", -1.0, 1), ("b1_in", 6.0, 2), ("pub", -5.0, 3)]


def test_software_in_a_row_and_a_subscriber_that_is_no_hardware(tmp_path: Path) -> None:
    model = "def respond(block, m):\n    return [('pub', m)]\n"
    sent, expected = shown(row(tmp_path, "soft", "soft", "hard", code=DOUBLE, model=model, sent=TWO))
    assert sent == [("b1_out", 4.0), ("b1_out", 20.0)]
    assert expected == [("pub", 1.0, 0), ("pub", 5.0, 1)]


def test_a_publisher_that_is_no_hardware_is_compared_here(tmp_path: Path) -> None:
    model = "def respond(block, m):\n    return [('b1_in', m), ('pub', {**m, 'x': 2 * m['x'] + ERROR})]\n"
    found = row(tmp_path, "hard", "soft", code=DOUBLE, model=model.replace("ERROR", "0"), sent=TWO)
    sent, expected = shown(found)
    assert (sent, expected) == ([("sub", 1.0), ("sub", 5.0)], [("b1_in", 1.0, 0), ("b1_in", 5.0, 1)])
    # The table of the simulation shows what bypasses the hardware, too.
    lines = software_text(found.published).splitlines()
    assert [line for line in lines if line.startswith("<")] == ["< @0 pub", "< @1 pub"]
    assert bytes.fromhex(lines[1]) == encode(found.published[0].publisher.frame, point(2.0))
    text = "message 0 from software to 'pub': 'x' is 2.0, but the model has 3.0"
    with pytest.raises(InputError, match=text):
        row(tmp_path, "hard", "soft", code=DOUBLE, model=model.replace("ERROR", "1"), sent=TWO)


@pytest.mark.parametrize(
    ("sent", "text"),
    [
        ("b'abcd'", r"'data\[2\]' is 99, but the model has 33"),
        ("b'abc'", r"'data' is b'abc', but the model has b'ab!d'"),
        ("bytes(9999)", r"'data' is b'\\x00.{10,60}, but the model has b'ab!d'"),
    ],
)
def test_a_difference_is_found_in_a_long_message(tmp_path: Path, sent: str, text: str) -> None:
    array = "std_msgs/UInt8MultiArray"
    types = HARD + soft(tmp_path, "soft", f"def soft(m):\n    return {{**m, 'data': {sent}}}\n", array, array)
    blocks = (
        converter("sub", "subscriber", array, "s")
        + instance("s", "soft", "pub")
        + converter("pub", "publisher", array)
        + converter("in", "subscriber", "Point", "h")
        + instance("h", "hard", "out")
        + converter("out", "publisher", "Point")
    )
    model = "def respond(block, m):\n    return [('pub', {**m, 'data': b'ab!d'})]\n"
    message = {"layout": {"dim": [], "data_offset": 0}, "data": b""}
    with pytest.raises(InputError, match=f"^error: message 0 from software to 'pub': {text}$"):
        run(tmp_path, derived(tmp_path, specification(blocks, types)), model, ("sub", message))


@pytest.mark.parametrize(
    ("answer", "count"),
    [("[('b1_in', m)] + [('pub', m)] * next(N)", 1), ("[('b1_in', m), ('pub', m), ('pub', m)]", 4)],
)
def test_the_number_of_messages_is_compared(tmp_path: Path, answer: str, count: int) -> None:
    code, model = "def soft(m):\n    return m\n", f"N = iter([1, 0])\ndef respond(block, m):\n    return {answer}\n"
    with pytest.raises(InputError) as raised:
        row(tmp_path, "hard", "soft", code=code, model=model, sent=(("sub", point(1.0)),) * 2)
    assert str(raised.value) == f"error: software sends 2 messages to 'pub', but the model sends {count}"


def test_a_function_is_the_model_of_what_it_publishes(tmp_path: Path) -> None:
    """Its author writes the computation once."""
    code, model = "def soft(m):\n    return {'x': 2 * m['x']}\n", "def respond(block, m):\n    return [('b1_in', m)]\n"
    found = row(tmp_path, "hard", "soft", code=code, model=model, sent=(("sub", point(1.0)),) * 2)
    assert [item.publisher.block for item in found.responses] == ["b1_in", "b1_in"]


def test_what_a_model_says_of_messages_within_hardware_does_not_count(tmp_path: Path) -> None:
    """So one model serves wherever a block is."""
    model = "def respond(block, m):\n    return [('b0_in', m), ('b1_in', m), ('b2_in', m), ('pub', m)]\n"
    for kinds, publishers in (
        (("hard", "hard", "hard"), ["pub"]),
        (("hard", "soft", "hard"), ["b1_in", "pub"]),
        (("soft", "hard", "hard"), ["pub"]),
        (("soft", "hard", "soft"), ["b2_in"]),
    ):
        code = "def soft(m):\n    return m\n"
        found = row(tmp_path, *kinds, code=code, model=model, sent=(("sub", point(1.0)),))
        assert [item.publisher.block for item in found.responses] == publishers
    with pytest.raises(InputError, match=r"'respond' returned an invalid message for 'b0_in': .* has no field 'v'"):
        row(tmp_path, "hard", model="def respond(block, m):\n    return [('b0_in', {'v': 1})]\n", sent=TWO)


def test_software_may_send_nothing_and_keep_state(tmp_path: Path) -> None:
    """Each block of a type has a state of its own."""
    code = (
        "SEEN = []\n\ndef soft(m):\n    SEEN.append(m['x'])\n"
        "    return {**m, 'x': sum(SEEN)} if len(SEEN) > 1 else None\n"
    )
    model = "def respond(block, m):\n    return [('b1_in', m)]\n"
    sent = tuple(("sub", point(x)) for x in (1.0, 2.0, 4.0, 8.0))
    found, expected = shown(row(tmp_path, "hard", "soft", "soft", "hard", code=code, model=model, sent=sent))
    # The first block gives 3, 7, 15; the second nothing for 3.
    assert found == [("sub", 1.0), ("sub", 2.0), ("sub", 4.0), ("b2_out", 10.0), ("sub", 8.0), ("b2_out", 25.0)]
    assert [cause for *_, cause in expected] == [0, 1, 2, 4]


def test_a_function_is_called_when_all_its_messages_are_there(tmp_path: Path) -> None:
    code = "def mix(a, b):\n    return {**a, 'y': b['x']}, None if b['x'] > 2 else b\n"
    types = HARD + soft(tmp_path, "mix", code, "Point Point", "Point Point")
    blocks = (
        converter("left", "subscriber", "Point", "h")
        + instance("h", "hard", "m")
        + converter("right", "subscriber", "Point", "m")
        + instance("m", "mix", "pub", "g")
        + instance("g", "hard", "out")
        + converter("pub", "publisher", "Point")
        + converter("out", "publisher", "Point")
    )
    system = derived(tmp_path, specification(blocks, types))
    model = (
        "QUEUE = []\ndef respond(block, m):\n    if block == 'left':\n        QUEUE.append(m)\n"
        "        return [('m_in0', m)]\n"
        "    found = [('pub', {**QUEUE.pop(0), 'y': m['x']})]\n"
        "    return found + ([('out', m)] if m['x'] <= 2 else [])\n"
    )
    found = run(
        tmp_path,
        system,
        model,
        ("left", point(7.0)),
        ("left", point(8.0)),
        ("right", point(1.0)),
        ("right", point(3.0)),
    )
    sent, expected = shown(found)
    assert sent == [("left", 7.0), ("left", 8.0), ("m_out1", 1.0)]
    assert expected == [("m_in0", 7.0, 0), ("m_in0", 8.0, 1), ("out", 1.0, 2)]


def test_parts_of_a_message_meet_on_the_host(tmp_path: Path) -> None:
    """An input of two sources, an output that goes on in part, and a publisher of two sources."""
    part = "def NAME(m):\n    assert m.keys() == {'FIELD'}, m\n    return m\n"
    types = HARD
    for name, field in (("place", "position"), ("turn", "orientation")):
        line = soft(tmp_path, name, part.replace("NAME", name).replace("FIELD", field), "Pose", "Pose")
        types += line.replace("geometry_msgs/Pose}", f"geometry_msgs/Pose, include: [{field}]}}")
    types += soft(tmp_path, "both", "def both(m):\n    assert len(m) == 2\n    return m\n", "Pose", "Pose")
    blocks = (
        converter("sub", "subscriber", "Pose", "p", "t")
        + instance("p", "place", "b", "parts")
        + instance("t", "turn", "b", "parts")
        + instance("b", "both", "pub")
        + converter("pub", "publisher", "Pose")
        + converter("parts", "publisher", "Pose")
        + converter("in", "subscriber", "Point", "h")
        + instance("h", "hard", "out")
        + converter("out", "publisher", "Point")
    )
    pose = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"x": 4.0, "y": 5.0, "z": 6.0, "w": 7.0}}
    model = "def respond(block, m):\n    return [('out', m)] if block == 'in' else [('pub', m), ('parts', m)]\n"
    system = derived(tmp_path, specification(blocks, types))
    found = run(tmp_path, system, model, ("sub", pose), ("in", point(1.0)))
    assert shown(found) == ([("in", 1.0)], [("out", 1.0, 0)])
    with pytest.raises(
        InputError, match=r"message 0 from software to 'pub': 'position.x' is 1.0, but the model has 9.0"
    ):
        run(
            tmp_path,
            system,
            model.replace("('pub', m)", "('pub', {**m, 'position': {**m['position'], 'x': 9.0}})"),
            ("sub", pose),
        )


def test_elements_of_an_array_meet_in_parts(tmp_path: Path) -> None:
    types = HARD
    for name, field in (("first", "x"), ("second", "y"), ("third", "z")):
        code = f"def {name}(m):\n    assert all(point.keys() == {{'{field}'}} for point in m['points'])\n    return m\n"
        line = soft(tmp_path, name, code, "geometry_msgs/Polygon", "geometry_msgs/Polygon")
        types += line.replace("geometry_msgs/Polygon}", f"geometry_msgs/Polygon, include: [points.{field}]}}")
    types += soft(tmp_path, "both", "def both(m):\n    return m\n", "geometry_msgs/Polygon", "geometry_msgs/Polygon")
    blocks = (
        converter("sub", "subscriber", "geometry_msgs/Polygon", "a", "b", "c")
        + "".join(instance(block, kind, "d") for block, kind in (("a", "first"), ("b", "second"), ("c", "third")))
        + instance("d", "both", "pub")
        + converter("pub", "publisher", "geometry_msgs/Polygon")
        + converter("in", "subscriber", "Point", "h")
        + instance("h", "hard", "out")
        + converter("out", "publisher", "Point")
    )
    polygon = {"points": [{"x": 1.0, "y": 2.0, "z": 3.0}, {"x": 4.0, "y": 5.0, "z": 6.0}]}
    model = "def respond(block, m):\n    return [('pub', m)]\n"
    found = run(tmp_path, derived(tmp_path, specification(blocks, types)), model, ("sub", polygon))
    assert (found.stimuli, found.responses) == ([], [])


def test_an_answer_is_what_the_middleware_makes_of_it(tmp_path: Path) -> None:
    """A float32 has lost its last digits when the next function sees it."""
    types = HARD + soft(tmp_path, "rough", "def rough(m):\n    return {'data': m['x']}\n", "Point", "std_msgs/Float32")
    types += soft(
        tmp_path, "fine", "def fine(m):\n    return {'x': m['data'], 'y': 0, 'z': 0}\n", "std_msgs/Float32", "Point"
    )
    blocks = (
        converter("sub", "subscriber", "Point", "r")
        + instance("r", "rough", "f")
        + instance("f", "fine", "h")
        + instance("h", "hard", "pub")
        + converter("pub", "publisher", "Point")
    )
    found = run(
        tmp_path,
        derived(tmp_path, specification(blocks, types)),
        "def respond(*_):\n    return []\n",
        ("sub", point(0.1)),
    )
    assert shown(found)[0] == [("f_out", struct.unpack("<f", struct.pack("<f", 0.1))[0])]
    assert found.stimuli[0].message["y"] == 0.0


def test_software_cannot_change_what_others_get(tmp_path: Path) -> None:
    code = "def soft(m):\n    assert m['covariance'][0] == 1.0\n    m['covariance'][0] = m['pose']['position'] = None\n"
    posed = "geometry_msgs/PoseWithCovariance"
    types = soft(tmp_path, "soft", code, posed, "") + HARD
    blocks = (
        converter("sub", "subscriber", posed, "a", "b", "pub")
        + instance("a", "soft")
        + instance("b", "soft")
        + converter("pub", "publisher", posed)
    )
    pose = {"pose": {"position": point(1.0), "orientation": {**point(0.0), "w": 7.0}}, "covariance": [1.0] * 36}
    model = "def respond(block, m):\n    return [('pub', m)]\n"
    found = run(tmp_path, derived(tmp_path, specification(blocks, types)), model, ("sub", pose))
    assert found.stimuli[0].message == found.responses[0].message == pose


# --- software elsewhere -----------------------------------------------------------------------------------------------


def test_software_elsewhere_is_in_the_stimuli(tmp_path: Path) -> None:
    model = "def respond(block, m):\n    return [('b1_in' if block == 'sub' else 'pub', m)]\n"
    sent = (("sub", point(1.0)), ("b1_out", point(2.0)))
    found, expected = shown(row(tmp_path, "hard", "soft", "hard", model=model, sent=sent))
    assert found == [("sub", 1.0), ("b1_out", 2.0)]
    assert expected == [("b1_in", 1.0, 0), ("pub", 2.0, 1)]
    with pytest.raises(InputError) as raised:
        row(tmp_path, "hard", "soft", "hard", model=model, sent=sent[:1])
    assert str(raised.value) == (
        "error: the stimuli contain no message for 'b1_out'\n"
        "      = 'b1' has no sources, so the stimuli must contain its messages"
    )


def test_software_elsewhere_may_give_to_software_here(tmp_path: Path) -> None:
    types = HARD + elsewhere("far") + soft(tmp_path, "near", "def near(m):\n    return {**m, 'x': -m['x']}\n")
    blocks = (
        converter("sub", "subscriber", "Point", "h")
        + instance("h", "hard", "f")
        + instance("f", "far", "n", "p", "g")
        + instance("n", "near", "q", "f2")
        + instance("f2", "far", "r")
        + instance("g", "hard", "s")
        + "".join(converter(name, "publisher", "Point") for name in "pqrs")
    )
    system = derived(tmp_path, specification(blocks, types))
    assert [topic.block for topic in stimulated(system)] == ["sub", "f_out", "f2_out"]
    model = (
        "def respond(block, m):\n"
        "    names = {'sub': ['f_in'], 'f_out': ['p', 's', 'q'], 'f2_out': ['r']}[block]\n"
        "    return [(name, {**m, 'x': -m['x']} if name == 'q' else m) for name in names]\n"
    )
    sent = (("sub", point(1.0)), ("f_out", point(2.0)), ("f2_out", point(3.0)))
    assert shown(run(tmp_path, system, model, *sent)) == (
        [("sub", 1.0), ("f_out", 2.0)],
        [("f_in", 1.0, 0), ("s", 2.0, 1)],
    )


def test_a_model_must_say_what_goes_to_software(tmp_path: Path) -> None:
    with pytest.raises(InputError) as raised:
        row(tmp_path, "hard", "soft", "hard", code=DOUBLE, model="def respond(*_):\n    return []\n", sent=TWO)
    assert str(raised.value) == (
        "error: the model returns no message from hardware to 'b1'\n"
        "      = 'respond' must also return ('b1_in', message)"
    )


# --- faults of functions ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (
            "def soft(m):\n    return {**m, 'x': 1 / 0}\n",
            (
                "soft.py:2:23: error: 'soft' raised ZeroDivisionError for message 0 to 'b0': division by zero\n"
                "    2 |     return {**m, 'x': 1 / 0}\n"
            ),
        ),
        (
            "import no_such_package\n\ndef soft(m): return m\n",
            "soft.py:1:1: error: 'soft' raised ModuleNotFoundError: No module named 'no_such_package'\n",
        ),
        (
            "def soft(m):\n    raise SystemExit\n",
            "soft.py:2:5: error: 'soft' raised SystemExit for message 0 to 'b0'\n",
        ),
        (
            "def soft(m):\n    return 5\n",
            (
                "soft.py:2:5: error: for message 0 to 'b0', 'soft' returned 5, which is not a mapping of fields\n"
                "    2 |     return 5\n      |     ^\n"
                "      = the function must return geometry_msgs/Point as a mapping, or None to send nothing"
            ),
        ),
        (
            "def soft(m):\n    return [m]\n",
            "soft.py:2:5: error: for message 0 to 'b0', 'soft' returned [{'x': 1.0",
        ),
        (
            "\ndef soft(m):\n    return {'x': 1.0, 'v': 0.0}\n",
            "soft.py:3:23: error: for message 0 to 'b0', 'soft' returned an invalid message: geometry_msgs/Point",
        ),
        (
            "def soft(m):\n    return {**m, 'x': 'one'}\n",
            "soft.py:2:18: error: for message 0 to 'b0', 'soft' returned an invalid message: 'x' must be of type",
        ),
        ("if False:\n    def soft(m): return m\n", "soft.py:1:1: error: soft.py has no function 'soft(message)'\n"),
    ],
)
def test_a_fault_of_a_function_is_shown_there(tmp_path: Path, code: str, message: str) -> None:
    with pytest.raises(InputError) as raised:
        row(tmp_path, "soft", "hard", code=code, model="def respond(*_):\n    return []\n", sent=TWO)
    found = str(raised.value).replace(f"{tmp_path}/", "")
    assert found.startswith(message)
    assert "Traceback" not in found


@pytest.mark.parametrize(
    ("outputs", "answer", "hint"),
    [
        ("", "m", "the accelerator has no output, so the function must return nothing"),
        (
            "Point Pose",
            "m",
            "the function must return a tuple of geometry_msgs/Point, geometry_msgs/Pose, each as a mapping, or None",
        ),
        ("Point Pose", "(m, m, m)", "the function must return a tuple"),
    ],
)
def test_a_function_returns_as_many_messages_as_it_has_outputs(
    tmp_path: Path, outputs: str, answer: str, hint: str
) -> None:
    types = HARD + soft(tmp_path, "soft", f"def soft(m):\n    return {answer}\n", "Point", outputs)
    names = [f"p{number}" for number in range(len(outputs.split()))]
    blocks = converter("sub", "subscriber", "Point", "s", "h") + instance("s", "soft", *names)
    blocks += "".join(converter(*item) for item in zip(names, ["publisher"] * 2, outputs.split(), strict=False))
    blocks += instance("h", "hard", "pub") + converter("pub", "publisher", "Point")
    with pytest.raises(InputError) as raised:
        run(tmp_path, derived(tmp_path, specification(blocks, types)), "def respond(*_):\n    return []\n", *TWO)
    assert "soft.py:2:5: error: for message 0 to 's', 'soft' returned " in str(raised.value)
    assert f"      = {hint}" in str(raised.value)


# --- sources ----------------------------------------------------------------------------------------------------------


def helped(folder: Path, sources: str, code: str) -> Traffic:
    """The traffic of software beside which `gain.py` lies."""
    (folder / "gain.py").write_text("GAIN = 3\n", encoding="utf-8")
    types = HARD + soft(folder, "soft", code).replace("sources: [soft.py]", f"sources: [{sources}]")
    blocks = converter("sub", "subscriber", "Point", "s") + instance("s", "soft", "h")
    blocks += instance("h", "hard", "pub") + converter("pub", "publisher", "Point")
    return run(folder, derived(folder, specification(blocks, types)), "def respond(*_):\n    return []\n", *TWO)


@pytest.mark.parametrize(
    "code",
    [
        "from gain import GAIN\n\ndef soft(m):\n    return {**m, 'x': GAIN * m['x']}\n",
        "def soft(m):\n    import gain\n    return {**m, 'x': gain.GAIN * m['x']}\n",
    ],
)
def test_sources_import_each_other(tmp_path: Path, code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    paths, modules = [*sys.path], {*sys.modules}
    found = helped(tmp_path, "soft.py, gain.py", code)
    assert [item.message["x"] for item in found.stimuli] == [3.0, 15.0]
    assert sys.path == paths
    assert "gain" not in sys.modules.keys() - modules
    # Nothing is left that another run would take for its own.
    assert not (tmp_path / "__pycache__").exists()


@pytest.mark.parametrize(("module", "file"), [("gain", "gain.py"), ("parts.gain", "parts/__init__.py")])
def test_what_is_imported_must_be_a_source(tmp_path: Path, module: str, file: str) -> None:
    (tmp_path / "parts").mkdir()
    for name in ("__init__", "gain"):
        (tmp_path / "parts" / f"{name}.py").write_text("GAIN = 3\n", encoding="utf-8")
    code = f"from {module} import GAIN\n\ndef soft(m):\n    return m\n"
    with pytest.raises(InputError) as raised:
        helped(tmp_path, "soft.py", code)
    text = str(raised.value)
    assert text.startswith("spec.yaml:") and text.endswith("      = list all files of the accelerator in 'sources'")
    assert f"error: software imports {file}, which is not one of the sources\n" in text
    assert not {"gain", "parts", "parts.gain"} & sys.modules.keys()
    if module != "gain":
        assert len(helped(tmp_path, "soft.py, parts/__init__.py, parts/gain.py", code).stimuli) == 2


def test_other_packages_are_no_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment below the folder of the specification is not the user's software."""
    installed = tmp_path / ".venv" / "lib"
    installed.mkdir(parents=True)
    (installed / "gain_of_others.py").write_text("GAIN = 3\n", encoding="utf-8")
    monkeypatch.syspath_prepend(installed)
    assert len(helped(tmp_path, "soft.py", "import gain_of_others\n\ndef soft(m):\n    return m\n").stimuli) == 2
    assert sys.modules.pop("gain_of_others").GAIN == 3
