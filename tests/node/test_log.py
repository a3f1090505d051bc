"""The lines of a node for its user: printed once, and passed to each log of ROS."""

from __future__ import annotations

from fusesoc_firm.node.engine.log import Level, Log


def test_logs_of_ros_get_the_lines_before_and_after_their_connection() -> None:
    printed: list[str] = []
    first: list[tuple[Level, str]] = []
    second: list[tuple[Level, str]] = []
    log = Log(printed.append)
    log.warn("a name is in use")
    log.connect(lambda level, text: first.append((level, text)))
    log.info("it is a node")
    log.connect(lambda level, text: second.append((level, text)))
    log.pass_on(Level.ERROR, "it ends")
    assert printed == ["a name is in use", "it is a node"]
    assert first == [(Level.WARNING, "a name is in use"), (Level.INFO, "it is a node"), (Level.ERROR, "it ends")]
    assert second == first


def test_only_the_latest_lines_before_a_connection_are_kept() -> None:
    log, found = Log(lambda _: None), list[str]()
    for number in range(1000):
        log.info(str(number))
    log.connect(lambda _, text: found.append(text))
    assert found[-1] == "999"
    assert len(found) == 50
