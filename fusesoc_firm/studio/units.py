"""The units of numbers in common messages of ROS, which follow REP 103: metres, seconds, radians."""

from __future__ import annotations

_LENGTH, _SPEED, _TURN = "m", "m/s", "rad/s"
# For each type, the fields by the begin of their dotted names; the longest one counts.
_PLACE = {"position": _LENGTH, "translation": _LENGTH}
_MOTION = {"linear": _SPEED, "angular": _TURN}
_UNITS: dict[str, dict[str, str]] = {
    "geometry_msgs/Point": {"": _LENGTH},
    "geometry_msgs/PointStamped": {"point": _LENGTH},
    "geometry_msgs/Pose": _PLACE,
    "geometry_msgs/PoseStamped": {f"pose.{name}": unit for name, unit in _PLACE.items()},
    "geometry_msgs/PoseWithCovarianceStamped": {f"pose.pose.{name}": unit for name, unit in _PLACE.items()},
    "geometry_msgs/Transform": _PLACE,
    "geometry_msgs/TransformStamped": {f"transform.{name}": unit for name, unit in _PLACE.items()},
    "geometry_msgs/Twist": _MOTION,
    "geometry_msgs/TwistStamped": {f"twist.{name}": unit for name, unit in _MOTION.items()},
    "geometry_msgs/Accel": {"linear": "m/s²", "angular": "rad/s²"},
    "geometry_msgs/Wrench": {"force": "N", "torque": "N m"},
    "nav_msgs/Odometry": {"pose.pose.position": _LENGTH}
    | {f"twist.twist.{name}": unit for name, unit in _MOTION.items()},
    "sensor_msgs/BatteryState": {"voltage": "V", "current": "A", "charge": "Ah", "capacity": "Ah", "temperature": "°C"},
    "sensor_msgs/FluidPressure": {"fluid_pressure": "Pa", "variance": "Pa²"},
    "sensor_msgs/Imu": {"angular_velocity": _TURN, "linear_acceleration": "m/s²"},
    "sensor_msgs/LaserScan": {"angle_": "rad", "range": _LENGTH, "time_increment": "s", "scan_time": "s"},
    "sensor_msgs/MagneticField": {"magnetic_field": "T"},
    "sensor_msgs/NavSatFix": {"latitude": "°", "longitude": "°", "altitude": _LENGTH},
    "sensor_msgs/Range": {"field_of_view": "rad", "min_range": _LENGTH, "max_range": _LENGTH, "range": _LENGTH},
    "sensor_msgs/Temperature": {"temperature": "°C", "variance": "°C²"},
}


def unit_of(message: str, field: str) -> str:
    """Return the unit of a field by its dotted name, or an empty text if the type does not define it."""
    known = _UNITS.get(message, {})
    found = [] if "covariance" in field else [name for name in known if field.startswith(name)]
    return known[max(found, key=len)] if found else ""
