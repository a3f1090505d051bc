"""The accelerators in Python of demo systems compute what their pages state: geometry, statistics, minima, cells."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from fusesoc_firm.accelerator.hardware_numbers import silent, typed
from fusesoc_firm.accelerator.user_code import Numbers, load_compiled
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from tests.applications.applications import SPECS
from tests.seeds import seeded

_SEED = seeded(20261201)
_LIBRARY = MessageLibrary(ROS2)


def accelerator(name: str, message: str, folder: str = "", numbers: str = "") -> Callable[[Mapping[str, Any]], Any]:
    """Return the function of a demo system, which receives messages with omitted fields left out."""
    path = SPECS / (folder or name) / "python" / f"{name}.py"
    function = load_compiled(path, name, name, ("m", ""), Numbers(numbers))
    parsed = parse_name(message)
    frame = frame_of(parsed, _LIBRARY.closure(parsed))

    def answer(content: Mapping[str, Any]) -> Any:
        with silent():
            return function.call(typed(frame, content, numbers))

    return answer


def vector(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def test_the_attitude_follows_a_steady_turn_and_settles_at_gravity() -> None:
    respond = accelerator("complementary_filter", "sensor_msgs/Imu")
    angle, rate, found = 0.0, 0.3, 0.0
    for _ in range(300):
        angle += rate * 0.01
        gravity = vector(0.0, 9.81 * math.sin(angle), 9.81 * math.cos(angle))
        message = {"header": {}, "angular_velocity": vector(rate, 0.0, 0.0), "linear_acceleration": gravity}
        found = respond(message)["vector"]["x"]
    assert found == pytest.approx(angle, abs=1e-3)
    still = {"header": {}, "angular_velocity": vector(0.0, 0.0, 0.0), "linear_acceleration": vector(-4.0, 0.0, 4.0)}
    for _ in range(1000):
        answer = respond(still)["vector"]
    assert (answer["x"], answer["y"]) == (pytest.approx(0.0, abs=1e-6), pytest.approx(math.pi / 4, abs=1e-6))


def test_the_angles_of_the_arm_lead_to_the_point() -> None:
    print("seed", _SEED)
    source, reached = random.Random(_SEED), 0
    respond = accelerator("inverse_kinematics", "geometry_msgs/PointStamped")
    for _ in range(300):
        x, y, z = (source.uniform(-0.5, 0.5) for _ in range(3))
        answer = respond({"header": {}, "point": vector(x, y, z)})
        distance = math.dist((x, y, z), (0.0, 0.0, 0.12))
        assert (answer is not None) == (0.05 <= distance <= 0.45)
        if answer:
            base, shoulder, elbow = answer["data"]
            across = 0.25 * math.cos(shoulder) + 0.2 * math.cos(shoulder + elbow)
            up = 0.12 + 0.25 * math.sin(shoulder) + 0.2 * math.sin(shoulder + elbow)
            assert (across * math.cos(base), across * math.sin(base), up) == pytest.approx((x, y, z), abs=1e-9)
            reached += 1
    assert 50 < reached < 290


def test_the_quaternion_of_three_turns_gives_their_angles() -> None:
    print("seed", _SEED)
    source = random.Random(_SEED)
    respond = accelerator("quat2euler_python", "geometry_msgs/Quaternion", "quat2euler")
    for _ in range(100):
        angles = (source.uniform(-3.1, 3.1), source.uniform(-1.5, 1.5), source.uniform(-3.1, 3.1))
        (cr, cp, cy), (sr, sp, sy) = (tuple(f(angle / 2) for angle in angles) for f in (math.cos, math.sin))
        quaternion = {
            "x": sr * cp * cy - cr * sp * sy,
            "y": cr * sp * cy + sr * cp * sy,
            "z": cr * cp * sy - sr * sp * cy,
            "w": cr * cp * cy + sr * sp * sy,
        }
        answer = respond(quaternion)
        assert (answer["x"], answer["y"], answer["z"]) == pytest.approx(angles, abs=1e-9)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 64, 127])
def test_the_scan_of_sectors_has_the_minima(count: int) -> None:
    print("seed", _SEED)
    source = random.Random(_SEED + count)
    ranges = [np.float32(source.choice([source.uniform(0.0, 4.0), math.inf, math.nan])) for _ in range(count)]
    message = {"header": {}, "angle_min": -1.0, "angle_max": 1.0, "angle_increment": 0.01, "range_min": 0.5}
    answer, nearest = accelerator("scan_sectors", "sensor_msgs/LaserScan")(
        {**message, "range_max": 3.5, "ranges": ranges, "intensities": []}
    )
    size = -(-count // 8)
    valid = [r if 0.5 <= r <= 3.5 else np.float32(math.inf) for r in ranges]
    wanted = [min(valid[i * size : (i + 1) * size], default=math.inf) for i in range(8)]
    assert answer["ranges"] == wanted
    assert nearest["data"] == min(wanted)
    assert answer["angle_increment"] == pytest.approx(0.01 * size)


def test_occupied_cells_are_those_with_a_point() -> None:
    print("seed", _SEED)
    source = random.Random(_SEED)
    points = [vector(source.uniform(-2.5, 2.5), source.uniform(-2.5, 2.5), source.uniform(-0.5, 2)) for _ in range(60)]
    answer = accelerator("cloud_occupancy", "sensor_msgs/PointCloud")({"header": {}, "points": points, "channels": []})
    wanted = np.zeros((8, 8), int)
    for point in points:
        if max(abs(point["x"]), abs(point["y"])) < 2.0 and 0.1 <= point["z"] < 1.5:
            wanted[math.floor(point["y"] * 2) + 4, math.floor(point["x"] * 2) + 4] = 100
    assert answer["data"] == wanted.ravel().tolist()
    assert (answer["info"]["width"], answer["info"]["height"], answer["info"]["resolution"]) == (8, 8, 0.5)


def test_the_kalman_filter_is_that_of_numpy() -> None:
    print("seed", _SEED)
    source = random.Random(_SEED)
    respond = accelerator("state_kalman", "sensor_msgs/Range", numbers="float64")
    motion, state, p = np.array([[1.0, 0.02], [0.0, 1.0]]), np.zeros(2), np.eye(2)
    push = np.array([0.5 * 0.02**2, 0.02])
    for number in range(100):
        measured = 2.0 + 0.01 * number + source.uniform(-0.05, 0.05) if number % 7 else math.inf
        answer = respond({"header": {}, "min_range": 0.1, "max_range": 9.0, "range": measured})["vector"]
        state, p = motion @ state, motion @ p @ motion.T + np.outer(push, push)
        if math.isfinite(measured):
            gain = p[:, 0] / (p[0, 0] + 0.0025)
            state, p = state + gain * (measured - state[0]), p - np.outer(gain, p[0])
        assert (answer["x"], answer["y"], answer["z"]) == pytest.approx((*state, p[0, 0]), rel=1e-6, abs=1e-9)


def test_each_joint_has_a_controller_of_its_own() -> None:
    path = SPECS / "joint_pid" / "python" / "joint_pid.py"
    respond = load_compiled(path, "joint_pid", "joint_pid", ("state, targets", "")).call
    sums, before, angles = [0.0] * 4, [0.0] * 4, [0.1, -0.2, 0.3, 2000.0]
    for number in range(5):
        targets = [0.5 * number, 0.0, -0.5, 0.0]
        errors = [target - angle for target, angle in zip(targets, angles, strict=True)]
        sums = [min(max(total + 0.01 * error, -10.0), 10.0) for total, error in zip(sums, errors, strict=True)]
        wanted = [1.5 * e + s + 0.2 * (e - b) for e, s, b in zip(errors, sums, before, strict=True)]
        answer = respond(_State(position=angles), _State(angles=targets))
        assert answer["data"] == pytest.approx(wanted)
        before = errors


class _State:
    """A message with these fields."""

    def __init__(self, **fields: list[float]) -> None:
        self.__dict__.update(fields)


def test_a_command_turns_to_what_is_seen() -> None:
    """A bright square in rows of 32 pixels, first on the left, then on the right, and seen ever more clearly."""
    folder = SPECS / "perception" / "python"

    def function(file: str, name: str, *messages: str) -> Callable[..., Any]:
        loaded = load_compiled(folder / file, name, name, ("m", "n"), Numbers("float32"))
        frames = [frame_of(parse_name(item), _LIBRARY.closure(parse_name(item))) for item in messages]

        def answer(*contents: Any) -> Any:
            with silent():
                return loaded.call(
                    *(typed(frame, item, "float32") for frame, item in zip(frames, contents, strict=True))
                )

        return answer

    image, point, number, twist = "sensor_msgs/Image", "geometry_msgs/Point", "std_msgs/Float32", "geometry_msgs/Twist"
    edges, regions, contrast = (function("vision.py", name, image) for name in ("edges", "regions", "contrast"))
    smoothing, tracker = function("motion.py", "smoothing", point), function("motion.py", "tracker", point)
    gain, control = function("motion.py", "gain", number), function("motion.py", "control", twist, number)

    def command(left: int, value: int) -> tuple[Any, Any]:
        pixels = [value if left <= column < left + 4 else 0 for _ in range(8) for column in range(32)]
        found = edges({"header": {}, "height": 8, "width": 32, "step": 32, "data": pixels})
        place = regions(found)
        # The edges of a square are at its first column and at the one after it.
        assert (place["x"], place["y"]) == (left + 2, 3.5)
        return control(tracker(smoothing(place)), gain(contrast(found))), place

    for _ in range(8):
        left, _ = command(4, 100)
    for _ in range(8):
        right, _ = command(24, 100)
    brighter, _ = command(24, 200)
    assert left["angular"]["z"] > 0 > right["angular"]["z"] > brighter["angular"]["z"]
    assert left["linear"]["x"] > 0
