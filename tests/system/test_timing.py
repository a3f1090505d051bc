"""Times of the specification in cycles, and what a scheduler gets of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.derived.model import DerivedSystem, PublisherTimes, Scheduling
from fusesoc_firm.system.derived.timing import bounds_of, frame_beats
from fusesoc_firm.system.hardware.configuration import system_configuration
from fusesoc_firm.system.views.show import derived_description
from tests.system.systems import LIBRARIES, converter, derived, read, specification

PREEMPTIVE = {"fixed_priority_preemptive", "edf_resources", "edf_latency", "lst"}


def system(folder: Path, project: str, *publishers: str) -> DerivedSystem:
    """Publishers p0, p1, ... of Point, each with these keys, or of Pose where these begin with `message`."""
    blocks = ""
    for number, keys in enumerate(publishers):
        message = "message: geometry_msgs/Point, " if "message" not in keys else ""
        kind = keys.split("message: ")[1].split(",")[0] if "message" in keys else "Point"
        blocks += converter(f"s{number}", "subscriber", kind, f"p{number}")
        blocks += f"  - {{name: p{number}, middleware: ROS, mode: publisher, {message}{keys}}}\n"
    return derived(folder, specification(blocks, project=f"{{name: robot, {project}}}"))


def times(folder: Path, keys: str, project: str = "clock: 100 MHz") -> PublisherTimes:
    return system(folder, project, keys).scheduling.times[0]


@pytest.mark.parametrize(
    ("period", "clock", "cycles"),
    [
        ("1234", "100 MHz", 1234),
        ("10 ms", "100 MHz", 1_000_000),
        ("10ms", "12.5 MHz", 125_000),
        ("0.5 us", "100 MHz", 50),
        ("333 ns", "50 MHz", 16),  # of 16.65: a period that is too long would be too late
        ("1 s", "1 kHz", 1000),
        ("100 Hz", "100 MHz", 1_000_000),
        ("3 kHz", "100 MHz", 33_333),
        ("30 Hz", "100 MHz", 3_333_333),
    ],
)
def test_a_period_in_cycles(tmp_path: Path, period: str, clock: str, cycles: int) -> None:
    assert times(tmp_path, f"period: {period}", f"clock: {clock}").period == cycles


def test_a_transfer_time_is_rounded_up(tmp_path: Path) -> None:
    assert times(tmp_path, "wcet: 333 ns", "clock: 50 MHz").transfer_time == 17


def test_the_deadline_is_the_period_unless_given(tmp_path: Path) -> None:
    assert times(tmp_path, "period: 500") == PublisherTimes(500, 29, 500)
    assert times(tmp_path, "period: 500, deadline: 200") == PublisherTimes(500, 29, 200)
    assert times(tmp_path, "deadline: 600") == PublisherTimes(None, 29, 600)
    assert times(tmp_path, "wcet: 40") == PublisherTimes(None, 40, None)


@pytest.mark.parametrize(("width", "beats"), [(8, 29), (16, 15), (32, 8), (64, 4), (256, 1), (512, 1)])
def test_the_size_of_a_message_says_how_long_it_is_sent(tmp_path: Path, width: int, beats: int) -> None:
    assert times(tmp_path, "period: 500", f"width: {width}").transfer_time == beats == frame_beats(24, width)


def test_a_message_without_bound_is_sent_for_nobody_knows_how_long(tmp_path: Path) -> None:
    assert times(tmp_path, "message: std_msgs/String, period: 500").transfer_time is None
    assert times(tmp_path, "message: std_msgs/String, period: 500, wcet: 90").transfer_time == 90


def test_a_limit_says_how_long_a_message_is_sent(tmp_path: Path) -> None:
    text = "message: std_msgs/String, period: 500"
    assert (
        times(tmp_path, f"{text}, maxLength: 95").transfer_time == times(tmp_path, f"{text}, buffer: 95").transfer_time
    )
    assert times(tmp_path, f"{text}, maxLength: 95").transfer_time == frame_beats(95, 8)
    assert times(tmp_path, f"{text}, maxLength: 95, wcet: 90").transfer_time == 90


@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_gets_its_generics(tmp_path: Path, policy: str) -> None:
    keys = ("period: 500", "period: 90, deadline: 80, wcet: 30")
    found = system(tmp_path, f"scheduler: {policy}, shortestRun: 4", *keys)
    configuration = system_configuration(found)
    generics = {item["formal"].strip(): item["actual"] for item in configuration["scheduler_generics"]}
    expected = {"REQUESTERS": "2"}
    if policy == "fixed_priority_preemptive":
        expected["PREEMPTIVE"] = "true"
    if policy.startswith("edf") or policy == "lst":
        # 500 cycles and both frames, 3 bits more.
        expected |= {"PERIODS": "PERIODS", "DEADLINES": "DEADLINES", "TIME_BITS": "13"}
    if policy == "lst":
        expected["TRANSFER_TIMES"] = "TRANSFER_TIMES"
    if policy in PREEMPTIVE:
        expected["SHORTEST_RUN"] = "4"
    assert generics == expected
    assert found.scheduling.is_preemptive == (policy in PREEMPTIVE)
    constants = (configuration["scheduler_times"] or {"constants": []})["constants"]
    cycles = {item["name"]: [value["cycles"] for value in item["values"]] for item in constants}
    known = {"PERIODS": [500, 90], "DEADLINES": [500, 80], "TRANSFER_TIMES": [29, 30]}
    assert cycles == {name: known[name] for name in expected if name in known}


def test_the_time_is_as_wide_as_the_longest_deadline_needs(tmp_path: Path) -> None:
    assert system(tmp_path, "scheduler: round_robin", "wcet: 1").scheduling.time_bits == 8
    assert system(tmp_path, "scheduler: edf_latency", "period: 268435455").scheduling.time_bits == 31


def test_show_tells_them(tmp_path: Path) -> None:
    found = derived_description(system(tmp_path, "scheduler: lst", "period: 500", "deadline: 80"))
    assert (found["System"]["scheduler"], found["System"]["shortestRun"]) == ("lst", 16)
    first, second = found["Converters"]["msg_to_AXIS"]
    assert [first[key] for key in ("periodCycles", "wcetCycles", "deadlineCycles")] == [500, 29, 500]
    assert "periodCycles" not in second and second["deadlineCycles"] == 80


def test_a_scheduler_without_times_shows_none(tmp_path: Path) -> None:
    found = system(tmp_path, "width: 8", "wcet: 7")
    assert found.scheduling == Scheduling("fixed_priority", (PublisherTimes(None, 7, None),), False, 16, 8)
    assert "shortestRun" not in derived_description(found)["System"]


def test_auto_takes_the_smallest_that_holds_all_deadlines(tmp_path: Path) -> None:
    relaxed = system(tmp_path, "scheduler: auto", "period: 500", "period: 700").scheduling
    assert relaxed.policy == "round_robin"
    # The second one's deadline is shorter than the first one's frame, and it has the lower priority.
    urgent = system(
        tmp_path, "scheduler: auto", "message: geometry_msgs/Pose, period: 2000", "period: 100, deadline: 60"
    )
    assert urgent.scheduling.policy == "edf_latency"
    assert urgent.scheduling.is_preemptive
    assert derived_description(urgent)["System"]["because"] == [*urgent.scheduling.reasons]
    first = system(
        tmp_path, "scheduler: auto", "period: 100, deadline: 60", "message: geometry_msgs/Pose, period: 2000"
    )
    assert first.scheduling.policy == "fixed_priority_preemptive"


def test_what_is_certain_of_each_publisher_is_shown(tmp_path: Path) -> None:
    """Points of 29 beats: the second waits for the first, the first for a frame of the second that has begun."""
    publishers = ("period: 100, deadline: 60", "period: 100, deadline: 50")
    found = derived_description(system(tmp_path, "scheduler: fixed_priority", *publishers))
    first, second = found["Converters"]["msg_to_AXIS"]
    bounds = bounds_of(system(tmp_path, "scheduler: fixed_priority", *publishers))
    assert [bound.task.name for bound in bounds] == ["p0", "p1"]
    for shown, bound in zip((first, second), bounds, strict=True):
        assert shown["worstResponseCycles"] == bound.response
        assert shown["worstLatenessCycles"] == bound.lateness
        assert shown["latenessBufferBytes"] == bound.buffer
    assert 58 <= first["worstResponseCycles"] <= 60
    # It is late by what the first one takes, and a byte may come in each cycle of that.
    assert second["latenessBufferBytes"] == second["worstLatenessCycles"] > 0


def test_who_may_starve_has_no_bound(tmp_path: Path) -> None:
    publishers = ("period: 29", "period: 1000")
    _, second = derived_description(system(tmp_path, "scheduler: fixed_priority", *publishers))["Converters"][
        "msg_to_AXIS"
    ]
    assert second["worstLatenessCycles"] == "no bound: it may never be served"


def test_without_all_times_nothing_is_certain(tmp_path: Path) -> None:
    found = system(tmp_path, "scheduler: fixed_priority", "period: 500", "deadline: 80")
    assert bounds_of(found) == ()
    assert "worstLatenessCycles" not in derived_description(found)["Converters"]["msg_to_AXIS"][0]


def test_a_combined_scheduler(tmp_path: Path) -> None:
    groups = "groups: [{scheduler: edf_latency, publishers: [p0, p1]}, {scheduler: lst, publishers: p2}]"
    combined = system(tmp_path, f"scheduler: lru, {groups}", *["period: 5000"] * 3)
    assert combined.scheduling.is_preemptive
    assert bounds_of(combined) == ()
    shown = derived_description(combined)["System"]
    assert (shown["scheduler"], [group["scheduler"] for group in shown["groups"]]) == ("lru", ["edf_latency", "lst"])
    text = system_configuration(combined)
    generics = {item["formal"]: item["actual"] for item in text["scheduler_generics"]}
    assert (text["scheduler"], generics["TOP_POLICY"]) == ("firm_sched_combined", "firm.firm_sched_pkg.LRU")
    assert {"PERIODS", "DEADLINES", "TRANSFER_TIMES", "TIME_BITS", "SHORTEST_RUN"} < generics.keys()


def test_only_the_publishers_of_a_group_need_its_times(tmp_path: Path) -> None:
    groups = "groups: [{scheduler: lst, publishers: [p0]}, {scheduler: round_robin, publishers: [p1]}]"
    text = "message: std_msgs/String"
    combined = system(tmp_path, f"scheduler: lru, {groups}", f"{text}, period: 700, maxLength: 95", text)
    constants = system_configuration(combined)["scheduler_times"]["constants"]
    values = {item["name"]: [(value["cycles"], value["is_used"]) for value in item["values"]] for item in constants}
    assert values == {
        "PERIODS": [(700, True), (1, False)],
        "DEADLINES": [(700, True), (1, False)],
        "TRANSFER_TIMES": [(100, True), (1, False)],
    }


def test_fifos_for_late_frames(tmp_path: Path) -> None:
    keys = ["period: 80, deadline: 3"] * 2
    assert all(0 < item.late_bytes < 100 for item in system(tmp_path, "scheduler: round_robin", *keys).publishers)
    without = system(tmp_path, "scheduler: round_robin, latenessBuffers: none", *keys)
    assert not any(item.late_bytes for item in without.publishers)
    # The lower priority may wait for ever, so there is no bound.
    never = system(tmp_path, "scheduler: fixed_priority_preemptive", "period: 20", "period: 40")
    assert never.publishers[1].late_bytes == 0


def test_a_fifo_that_would_be_too_large(tmp_path: Path) -> None:
    block = "  - {name: p, middleware: ROS, mode: publisher, message: geometry_msgs/Point, wcet: 90000, KEYS}\n"
    blocks = converter("s", "subscriber", "Point", "p") + block.replace("KEYS", "period: 95000, deadline: 10")
    found, faults = read(tmp_path, specification(blocks, project="{name: robot, scheduler: round_robin}"))
    assert derive(found, tmp_path, LIBRARIES, faults).publishers[0].late_bytes == 0
    assert [item.message for item in faults.warnings] == [
        "'p' has no FIFO for the time in which its frames are late: it needs 89,991 bytes"
    ]
