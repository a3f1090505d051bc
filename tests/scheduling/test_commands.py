"""`firm scheduler bench` and `firm scheduler choose`, as a person calls them."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.scheduling.evaluation.metrics import METRICS

Captured = pytest.CaptureFixture[str]

SPEC = """
project: {name: robot, scheduler: fixed_priority, width: 32, clock: 100 MHz}
accelerators:
  - {name: copy, type: VHDL, sources: copy.vhd, interface: {
      input: [{middleware: ROS2, message: geometry_msgs/Point}],
      output: [{middleware: ROS2, message: geometry_msgs/Point}]}}
blocks:
  - {name: sub, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: a}, {name: b}]}
  - {name: a, type: copy, outgoing: [{name: fast}]}
  - {name: b, type: copy, outgoing: [{name: slow}]}
  - {name: slow, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, period: 1 kHz}
  - {name: fast, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, period: 100, deadline: 40, wcet: 12}
"""


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    (tmp_path / "copy.vhd").write_text("")
    path = tmp_path / "robot.yaml"
    path.write_text(SPEC)
    return path


def with_a_third(spec: str) -> str:
    """With two others in turn, the fast publisher would come too late: it needs a priority."""
    spec = spec.replace("{name: b}]", "{name: b}, {name: c}]").replace("deadline: 40", "deadline: 30")
    third = "{name: third, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, period: 1 kHz}"
    return f"{spec}  - {{name: c, type: copy, outgoing: [{{name: third}}]}}\n  - {third}\n"


def small_bench(*more: str) -> int:
    few = ("--requesters", "2,3", "--policies", "lru,fixed_priority", "--sets", "2", "--cycles", "500", "--jobs", "1")
    return main(["scheduler", "bench", *few, *more])


def test_bench_prints_a_summary_and_writes_all_values(tmp_path: Path, capsys: Captured) -> None:
    values = tmp_path / "values.csv"
    assert small_bench("--dataset", "large,cc1", "--csv", str(values), "--seed", "5") == 0
    captured = capsys.readouterr()
    assert "Large data set, large = ({100, 100}, 50): 2 sets, 500 cycles" in captured.out
    assert "seed 5" in captured.err
    assert "8 evaluations in" in captured.out
    rows = list(csv.DictReader(values.read_text().splitlines()))
    assert len(rows) == 8 and set(rows[0]) == {"data_set", "policy", "requesters", *METRICS}
    # Two accelerators, two tasks at least each: everybody is served.
    assert [row["granted"] for row in rows if row["requesters"] == "2"] == ["2"] * 4


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["--policies", "lur"], "unknown policy 'lur'\n      = did you mean 'lru'?"),
        (["--dataset", "cc5"], "unknown data set 'cc5'\n      = did you mean"),
        (["--requesters", "2,257"], "'257' is not a legal number of accelerators\n      = legal: 1 to 256"),
        (["--requesters", "x"], "'x' is not a legal number of accelerators"),
        (["--requesters", ""], "'' is not a legal number of accelerators"),
        (["--requesters", "0"], "'0' is not a legal number of accelerators"),
        (["--policies", ""], "unknown policy ''\n      = legal here: edf_latency"),
        (["--csv", "{file}/values.csv"], "/values.csv: there is no folder "),
    ],
)
def test_bad_arguments_of_bench(arguments: list[str], fault: str, tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "file"
    file.write_text("")
    assert main(["scheduler", "bench", *(word.format(file=file) for word in arguments)]) == 1
    assert fault in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "number", "fault"),
    [
        ("--sets", "0", "0 is less than 1"),
        ("--jobs", "-3", "-3 is less than 1"),
        ("--cycles", "many", "'many' is not a whole number"),
        ("--shortest-run", "0", "0 is less than 1"),
        ("--resume-beats", "-1", "-1 is less than 0"),
        ("--seed", "-1", "-1 is less than 0"),
    ],
)
def test_numbers_have_a_least_one(option: str, number: str, fault: str, capsys: Captured) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["scheduler", "bench", option, number])
    assert capsys.readouterr().err.endswith(f"argument {option}: {fault}\n")


def test_longer_runs_and_what_a_resumption_costs(tmp_path: Path, capsys: Captured) -> None:
    """LST interrupts less if it may not do so after every beat; a resumed run takes channel time without beats."""
    found = {}
    for name, options in {"bare": [], "bursts": ["--resume-beats", "1"], "long": ["--shortest-run", "32"]}.items():
        path = tmp_path / f"{name}.csv"
        few = ["--requesters", "4", "--policies", "lst", "--sets", "2", "--cycles", "2000", "--jobs", "1"]
        assert main(["scheduler", "bench", *few, *options, "--csv", str(path)]) == 0
        (row,) = csv.DictReader(path.read_text().splitlines())
        found[name] = {key: float(row[key]) for key in ("preemptions", "utilisation")}
    assert found["long"]["preemptions"] < found["bare"]["preemptions"] / 4
    assert found["bursts"]["utilisation"] < found["bare"]["utilisation"] - 5
    assert "a shortest run of 32 beats" in capsys.readouterr().err


def test_choose_tells_the_policy_and_why(spec: Path, capsys: Captured) -> None:
    spec.write_text(with_a_third(SPEC))
    assert main(["scheduler", "choose", str(spec)]) == 0
    out = capsys.readouterr().out
    assert out.startswith("scheduler: fixed_priority\n")
    # 5 bytes of header and 28 of payload in beats of 4; 100,000 cycles are 1 ms.
    assert "| slow      | 100000 |             9 |   100000 |" in out
    assert "List the publishers in the specification in the order of priority: fast, slow, third." in out


def test_choose_sees_that_publishers_stand_in_order(spec: Path, capsys: Captured) -> None:
    in_order = SPEC.replace("period: 1 kHz", "period: 100, deadline: 28").replace("deadline: 40", "deadline: 60")
    spec.write_text(with_a_third(in_order))
    assert main(["scheduler", "choose", str(spec)]) == 0
    assert "The priorities match the order of the publishers in the specification." in capsys.readouterr().out


@pytest.mark.parametrize("form", ["json", "yaml"])
def test_choose_gives_data(form: str, spec: Path, capsys: Captured) -> None:
    assert main(["scheduler", "choose", str(spec), "--format", form, "--criterion", "lateness"]) == 0
    out = capsys.readouterr().out
    data = json.loads(out) if form == "json" else yaml.safe_load(out)
    assert data["criterion"] == "lateness"
    assert data["utilisation"] == pytest.approx(0.12 + 9e-5)
    best = data["policies"][0]
    assert best["name"] == data["scheduler"]
    assert best["worstLatenessCycles"] == min(policy["worstLatenessCycles"] for policy in data["policies"])
    assert [publisher["name"] for publisher in best["publishers"]] == ["slow", "fast"]
    fast = best["publishers"][1]
    assert (fast["periodCycles"], fast["wcetCycles"], fast["deadlineCycles"]) == (100, 12, 40)
    assert fast["latenessCycles"] == fast["responseCycles"] - 40
    assert fast["bufferBytes"] == 0


def test_choose_needs_the_times(spec: Path, capsys: Captured) -> None:
    spec.write_text(SPEC.replace(", period: 1 kHz", "").replace("period: 100, ", ""))
    assert main(["scheduler", "choose", str(spec)]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "error: publisher 'slow' needs a 'period'" in captured.err
    assert "error: publisher 'fast' needs a 'period'" in captured.err
