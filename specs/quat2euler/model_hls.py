"""Model of QuaternionToEuler.cpp: the same float64 operations and libm calls in the same order, so the same bits.

It holds where Python and the C++ compiler use the same libm and the compiler fuses no products
(`-ffp-contract=off`).
"""

from __future__ import annotations

import math
import sys


def _wrap(angle: float) -> float:
    """The same angle in (-pi, pi]; -0 becomes 0."""
    if angle > math.pi:
        angle -= 2.0 * math.pi
    elif angle <= -math.pi:
        angle += 2.0 * math.pi
    return angle + 0.0


def quaternion_to_euler(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw in rad; NaN if an argument is not finite, zeros if none is normal."""
    if not all(map(math.isfinite, (x, y, z, w))):
        return math.nan, math.nan, math.nan
    largest = max(abs(x), abs(y), abs(z), abs(w))
    if largest < sys.float_info.min:
        return 0.0, 0.0, 0.0

    _, exponent = math.frexp(largest)
    x, y, z, w = (math.ldexp(component, -exponent) for component in (x, y, z, w))
    p = w + y + 0.0
    q = w - y + 0.0
    r = x + z
    s = z - x
    alpha = math.atan2(r, q)
    beta = math.atan2(s, p)
    # Not math.hypot, which rounds differently.
    pitch = 2.0 * math.atan2(math.sqrt(p * p + s * s), math.sqrt(q * q + r * r)) - 0.5 * math.pi + 0.0
    return _wrap(alpha - beta), pitch, _wrap(alpha + beta)


def respond(subscriber: str, message: dict[str, object]) -> list[tuple[str, dict[str, object]]]:
    """The messages that the system publishes when `subscriber` receives `message`."""
    if subscriber != "QuaternionToEuler_sub":
        raise ValueError(f"unknown subscriber '{subscriber}', legal: 'QuaternionToEuler_sub'")
    components = []
    for field in ("x", "y", "z", "w"):
        value = message[field]
        if not isinstance(value, float | int):
            raise TypeError(f"field '{field}' is {value!r}, not a number")
        components.append(float(value))
    roll, pitch, yaw = quaternion_to_euler(*components)
    return [("QuaternionToEuler_pub", {"x": roll, "y": pitch, "z": yaw})]
