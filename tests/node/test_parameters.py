"""The parameters of nodes: those of a master of ROS 1, and those of the command line and files of ROS 2."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest

from fusesoc_firm.node.interface.parameters import option_words, parameters_of
from fusesoc_firm.text.diagnostics import InputError


def of_ros2(*arguments: str, name: str = "robot") -> dict[str, Any]:
    """The parameters of a node of ROS 2."""
    return parameters_of([2], name, ["--ros-args", *arguments], pytest.fail)


@contextmanager
def master(known: dict[str, Any]) -> Iterator[str]:
    """A master that has these private parameters of `/arm/robot`."""
    server = SimpleXMLRPCServer(("127.0.0.1", 0), SimpleXMLRPCRequestHandler, logRequests=False)
    server.register_function(
        lambda _, key: [1, "", known] if key == "/arm/robot" and known else [-1, "not set", 0], "getParam"
    )
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_parameters_are_options() -> None:
    given = {"transport": "pipe:a b", "queue": 20, "drain": 2.5, "restart": True, "ros_python": "/usr/bin/python3"}
    assert option_words(given) == [
        "--transport=pipe:a b",
        "--queue=20",
        "--drain=2.5",
        "--restart",
        "--ros-python=/usr/bin/python3",
    ]
    assert option_words({"restart": False}) == []
    with pytest.raises(InputError, match=r"the parameter 'restart' is '1'(.|\n)*legal: true, false"):
        option_words({"restart": 1})


def test_the_command_line_of_ros_2() -> None:
    assert of_ros2("-p", "transport:=uart:/dev/ttyUSB1:1000000", "--param", "queue:=5", "-p", "other:=1") == {
        "transport": "uart:/dev/ttyUSB1:1000000",
        "queue": 5,
    }
    # Of another node; of this one, after its name; the last one counts.
    assert of_ros2("-p", "other:queue:=5", "-p", "robot:queue:=6", "-p", "queue:=7") == {"queue": 7}
    assert of_ros2("-r", "__node:=other", "-p", "other:queue:=5", "-p", "robot:queue:=6") == {"queue": 5}
    with pytest.raises(InputError, match=r"'-p queue=5' is not a parameter(.|\n)*legal: NAME:=VALUE"):
        of_ros2("-p", "queue=5")


@pytest.mark.parametrize(
    ("pattern", "is_meant"),
    [
        ("robot", False),
        ("/arm/robot", True),
        ("/**", True),
        ("/*/robot", True),
        ("/*", False),
        ("/**/robot", True),
    ],
)
def test_a_file_of_ros_2_names_nodes(tmp_path: Path, pattern: str, is_meant: bool) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(f'"{pattern}":\n  ros__parameters:\n    queue: 5\n    restart: true\n')
    found = of_ros2("-r", "__ns:=/arm", "--params-file", str(path))
    assert found == ({"queue": 5, "restart": True} if is_meant else {})


def test_a_file_may_be_nested_and_is_overridden(tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text("arm:\n  robot:\n    ros__parameters: {queue: 5, overflow: block}\n")
    arguments = ("-r", "__ns:=/arm", "--params-file", str(path), "-p", "queue:=6")
    assert of_ros2(*arguments) == {"queue": 6, "overflow": "block"}


@pytest.mark.parametrize(("text", "message"), [(None, "cannot read '"), ("{", "is not YAML")])
def test_a_file_that_is_none_is_reported(tmp_path: Path, text: str | None, message: str) -> None:
    path = tmp_path / "parameters.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=message):
        of_ros2("--params-file", str(path))


def test_a_master_has_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    with master({"transport": "pipe:simulator", "queue": 5, "other": 1}) as uri:
        monkeypatch.setenv("ROS_MASTER_URI", uri)
        given = parameters_of([1], "robot", ["__ns:=/arm", "_queue:=6", "sub:=/imu"], pytest.fail)
        assert given == {"transport": "pipe:simulator", "queue": 6}
        assert parameters_of([1], "other", ["__ns:=arm", "__name:=robot"], pytest.fail)["queue"] == 5
        assert not parameters_of([1], "robot", [], pytest.fail)
        monkeypatch.setenv("ROS_NAMESPACE", "/arm")
        assert parameters_of([1], "robot", [], pytest.fail)["queue"] == 5


def test_a_missing_master_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    with master({"queue": 5}) as uri:
        # Nothing listens at this port any more.
        pass
    monkeypatch.setenv("ROS_MASTER_URI", uri)

    class ReportedError(Exception): ...

    def report(text: str) -> None:
        raise ReportedError(text)

    with pytest.raises(ReportedError, match=f"waiting for a master at {uri}"):
        parameters_of([1], "robot", [], report)
