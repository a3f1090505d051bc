"""Bit-accurate model of the accelerator `mobile_robot`, and of the motors at its pins in simulation.

Kinematics and controllers compute on whole numbers, once per control period, as rtl/skid_steer.vhd and
rtl/wheel_pid.vhd do. The motors are those of tb/motor.vhd, advanced one PWM period at a time. They are linked by the
encoder's position some cycles ago, which is the position that a decoder has seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction

SPEED_FRACTION = 8
_TWIST_BITS, _TWIST_FRACTION = 23, 16
_GAIN_FRACTION, _BACK_FRACTION = 16, 32
_PI = 3.14159265358979323846
# Units of a motor's angle per count.
_COUNT_STEPS = 1 << 24


@dataclass(frozen=True)
class Parameters:
    """The generics of rtl/mobile_robot.vhd."""

    clock_hz: int = 100_000_000
    pwm_cycles: int = 5_000
    pwm_periods: int = 2
    track_width_um: int = 400_000
    wheel_radius_um: int = 100_000
    counts_per_turn: int = 204_800
    speed_limit: int = 40
    kp: int = 50_000
    ki: int = 5_500
    kd: int = 10_000
    timeout: int = 5_000
    stall_periods: int = 200
    filter: int = 4

    @property
    def counts_per_metre(self) -> float:
        """Counts per period at 1 m/s."""
        seconds_up = float(self.counts_per_turn) * float(self.pwm_cycles * self.pwm_periods) * 1.0e6
        return seconds_up / (2.0 * _PI * float(self.wheel_radius_um) * float(self.clock_hz))

    @property
    def counts_per_radian(self) -> float:
        """Counts per period of either side at 1 rad/s."""
        return self.counts_per_metre * float(self.track_width_um) / 2.0e6

    @property
    def seen_after(self) -> int:
        """Cycles from an encoder's edge to its count: two to synchronise, the filter, two to compare and count."""
        return self.filter + 4


def to_fixed(number: float) -> int | None:
    """A speed in units of 2**-16, rounded to nearest, at most 64; None if it is not a number."""
    if math.isnan(number):
        return None
    limit = (1 << (_TWIST_BITS - 1)) - 1
    if math.isinf(number):
        return limit if number > 0 else -limit
    magnitude = min(math.floor(abs(Fraction(number)) * 2**_TWIST_FRACTION + Fraction(1, 2)), limit)
    return -magnitude if number < 0 else magnitude


def setpoints(parameters: Parameters, x: float, z: float) -> tuple[int, int]:
    """The speeds of the left and the right wheels, in units of 2**-8 counts per period."""
    forward, turning = to_fixed(x), to_fixed(z)
    if forward is None or turning is None:
        return 0, 0
    forward *= round(parameters.counts_per_metre * 2**_GAIN_FRACTION)
    turning *= round(parameters.counts_per_radian * 2**_GAIN_FRACTION)
    limit = parameters.speed_limit << SPEED_FRACTION

    def speed(side: int) -> int:
        cut = _TWIST_FRACTION + _GAIN_FRACTION - SPEED_FRACTION
        return max(-limit, min(limit, (side + (1 << (cut - 1))) >> cut))

    return speed(forward - turning), speed(forward + turning)


def twist(parameters: Parameters, counts: list[int]) -> tuple[float, float]:
    """The twist of the wheels' counts in a period: x in m/s, z in rad/s."""
    front_left, front_right, rear_left, rear_right = counts
    x_back = round(0.25 / parameters.counts_per_metre * 2**_BACK_FRACTION)
    z_back = round(0.25 / parameters.counts_per_radian * 2**_BACK_FRACTION)
    return (
        sum(counts) * x_back / 2**_BACK_FRACTION,
        (front_right + rear_right - front_left - rear_left) * z_back / 2**_BACK_FRACTION,
    )


@dataclass
class Pid:
    """A wheel's controller; speeds in units of 2**-8 counts per period, the duty in cycles of the PWM."""

    parameters: Parameters
    integral: int = 0
    before: int = 0
    standing: int = 0

    def duty(self, setpoint: int, counts: int) -> int:
        """The duty for the next period, from the counts of the last one."""
        known = self.parameters
        limit = known.pwm_cycles
        error = setpoint - (counts << SPEED_FRACTION)
        slowing = (self.before - counts) << SPEED_FRACTION
        self.before = counts
        increased = self.integral + known.ki * error
        whole = (known.kp * error + increased + known.kd * slowing) >> 16
        is_beyond = (whole >= limit and error >= 0) or (whole < -limit and error < 0)
        if not is_beyond:
            self.integral = increased
        is_standing = counts == 0 and (whole >= limit or whole < -limit)
        self.standing = min(self.standing + 1, known.stall_periods) if is_standing else 0
        if setpoint == 0 and abs(counts) <= 1:
            self.integral = 0
            return 0
        return max(-limit, min(limit, whole))

    @property
    def is_stalled(self) -> bool:
        """Whether the wheel does not turn at full duty."""
        return self.standing == self.parameters.stall_periods


@dataclass
class Motor:
    """A motor and its encoder; speed in units of 2**-24 counts per cycle, angle in units of 2**-24 counts."""

    parameters: Parameters
    full_speed: int
    time_constant: int = 20
    speed: int = 0
    angle: int = 0
    is_held: bool = False
    # The last angle that a decoder has seen.
    seen: int = 0

    def run(self, duty: int) -> None:
        """Run a period of the PWM."""
        cycles = self.parameters.pwm_cycles
        speed = 0 if self.is_held else self.speed
        self.seen = self.angle + speed * (cycles - self.parameters.seen_after - 1)
        self.angle += speed * cycles
        change = duty * (self.full_speed // cycles) - self.speed
        # Rounded away from zero.
        self.speed += int(math.copysign(-(-abs(change) // self.time_constant), change))
        if self.is_held:
            self.speed = 0


@dataclass
class Robot:
    """The robot with its motors."""

    parameters: Parameters
    motors: list[Motor]
    pids: list[Pid] = field(default_factory=list)
    duties: list[int] = field(default_factory=lambda: [0] * 4)
    counts: list[int] = field(default_factory=lambda: [0] * 4)
    setpoints: tuple[int, int] = (0, 0)
    silence: int = 0

    def __post_init__(self) -> None:
        self.pids = [Pid(self.parameters) for _ in self.motors]

    def period(self, command: tuple[float, float] | None) -> tuple[float, float]:
        """Run a control period, at whose end a command may be taken, and return the measured twist."""
        for wheel, motor in enumerate(self.motors):
            before = motor.seen // _COUNT_STEPS
            for number in range(self.parameters.pwm_periods):
                # A duty is computed after the end of its control period, so it applies from the next PWM period.
                motor.run(self._running[wheel] if number == 0 else self.duties[wheel])
            self.counts[wheel] = motor.seen // _COUNT_STEPS - before
        self._running = list(self.duties)
        if command is not None:
            self.setpoints, self.silence = setpoints(self.parameters, *command), 0
        else:
            self.silence = min(self.silence + 1, self.parameters.timeout)
            if self.silence == self.parameters.timeout:
                self.setpoints = (0, 0)
        self.duties = [
            pid.duty(self.setpoints[wheel % 2], counts)
            for wheel, (pid, counts) in enumerate(zip(self.pids, self.counts, strict=True))
        ]
        return twist(self.parameters, self.counts)

    # The old duties, which still apply in the first PWM period.
    _running: list[int] = field(default_factory=lambda: [0] * 4)


# As in tb/chassis.vhd.
FULL_SPEEDS = (80_000, 75_000, 85_000, 80_000)
_robot = Robot(Parameters(), [Motor(Parameters(), full_speed) for full_speed in FULL_SPEEDS])


def respond(subscriber: str, message: dict[str, dict[str, float]]) -> list[tuple[str, dict[str, object]]]:
    """The message that the system publishes for the next one: a command is taken at the end of every period."""
    if subscriber != "command":
        raise ValueError(f"unknown subscriber '{subscriber}', legal: 'command'")
    x, z = _robot.period((message["linear"]["x"], message["angular"]["z"]))
    return [("measured", {"linear": {"x": x}, "angular": {"z": z}})]
