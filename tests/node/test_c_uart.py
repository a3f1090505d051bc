"""The UART's driver in C before a model of a Zynq's UART, whose FIFOs of 64 bytes fill and empty at 1 Mbaud."""

from __future__ import annotations

import pytest

from tests.node.drivers import C_FOLDER, HERE, Driver, compile_c_driver

SEED = "20261123"
PATIENCE_MS = 50


@pytest.fixture(scope="module", params=["bare_metal", "freertos"])
def uart(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Driver:
    sources = [f"firm/firm_{name}.c" for name in ("frame", "limit", "link", "uart")]
    sources.append(f"ports/{request.param}/firm_port.c")
    folders = [C_FOLDER / "ports" / request.param]
    sizes = {"FIRM_UART_PATIENCE_MS": PATIENCE_MS}
    if request.param == "freertos":
        folders.append(HERE / "freertos_stand_in")
        sizes["STAND_IN"] = 1
    return compile_c_driver("uart", tmp_path_factory.mktemp("uart"), sources, folders, sizes)


def _counts(driver: Driver, frames: int, *modes: str) -> dict[str, dict[str, int]]:
    """Return the counts of this side and of the board after `frames` frames each way."""
    print(f"seed {SEED}, modes {modes}")
    words = driver.answers([], str(frames), SEED, *modes)[0].split()
    # `board` stands for the board's `good`.
    at = words.index("board")
    here, board = words[:at], ["good", *words[at + 1 :]]
    return {
        side: dict(zip(row[::2], map(int, row[1::2]), strict=True)) for side, row in (("here", here), ("board", board))
    }


@pytest.mark.one_in(3)
@pytest.mark.parametrize("modes", [(), ("interrupt",), ("flow",), ("flow", "interrupt"), ("slow", "interrupt")])
def test_no_byte_is_lost_in_either_direction(uart: Driver, modes: tuple[str, ...]) -> None:
    """32 to 1,024 bytes in each frame, back to back, both ways at once."""
    counts = _counts(uart, 1000, *modes)
    assert counts["here"] == {"good": 1000, "wrong": 0, "broken": 0, "overruns": 0}
    assert counts["board"] == {"good": 1000, "wrong": 0, "broken": 0, "lost": 0}


@pytest.mark.parametrize("modes", [("slow", "flow")])
def test_the_board_waits_for_a_slow_program(uart: Driver, modes: tuple[str, ...]) -> None:
    counts = _counts(uart, 300, *modes)
    assert counts["here"] == {"good": 300, "wrong": 0, "broken": 0, "overruns": 0}
    assert counts["board"]["good"] == 300


def test_overruns_are_counted(uart: Driver) -> None:
    """A program that polls too rarely, without flow control: frames are lost, but none is wrong."""
    counts = _counts(uart, 300, "slow")["here"]
    assert counts["overruns"] > 0 and counts["broken"] > 0 and counts["wrong"] == 0
    assert counts["good"] < 300


@pytest.mark.parametrize("modes", [("held",), ("held", "interrupt"), ("held", "frozen")])
def test_a_board_that_takes_no_byte_costs_the_frame(uart: Driver, modes: tuple[str, ...]) -> None:
    counts = _counts(uart, 2, *modes)
    assert counts["board"] == {"good": 0, "wrong": 0, "broken": 0, "lost": 2}
    assert counts["here"]["good"] == 2


def test_the_line_opens_while_the_clock_stands_still(uart: Driver) -> None:
    """No scheduler runs yet, and no loop counts ticks."""
    counts = _counts(uart, 20, "frozen")
    assert counts["here"]["good"] == counts["board"]["good"] == 20
