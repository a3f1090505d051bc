"""ROS 2 as Python wheels, in an environment beside that of fusesoc-firm, for machines without ROS."""

from __future__ import annotations

import subprocess
import sys
import venv
from collections.abc import Sequence
from ctypes.util import find_library
from pathlib import Path

from fusesoc_firm.text.diagnostics import fail

# rclpy, the middleware that carries its messages, and the messages that most systems use; std_msgs follows from them.
WHEELS = {
    "jazzy": {
        "rclpy": "7.1.6",
        "rmw-fastrtps-cpp": "8.4.3",
        "diagnostic-msgs": "5.3.6",
        "geometry-msgs": "5.3.6",
        "sensor-msgs": "5.3.6",
    },
    "kilted": {
        "rclpy": "9.1.2",
        "rmw-fastrtps-cpp": "9.3.3",
        "diagnostic-msgs": "5.5.1",
        "geometry-msgs": "5.5.1",
        "sensor-msgs": "5.5.1",
    },
}
DEFAULT = "jazzy"


def ros_folder() -> Path:
    """Return the folder of the environment with the wheels, whether it exists or not."""
    return Path(sys.prefix) / "ros2"


def ros_python() -> Path:
    """Return the Python of the environment with the wheels, whether it exists or not."""
    return ros_folder() / "bin" / "python"


def install_wheels(packages: Sequence[str], distribution: str = DEFAULT) -> list[str]:
    """Install the wheels, and those of the message packages `packages` such as `nav_msgs`; return their requirements.

    An existing environment is kept and extended, unless it has another distribution. Raise `InputError` if pip fails or
    a library of Python is missing.
    """
    library = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    if not find_library(library):
        fail(f"ROS 2 needs the library lib{library}", hint=f"apt-get install lib{library}")
    wheels = requirements(distribution)
    further = [package.replace("_", "-") for package in packages]
    wheels += [_wheel(distribution, name) for name in further if name not in WHEELS[distribution]]
    is_other = any(_has(other) for other in WHEELS if other != distribution)
    if is_other or not ros_python().exists():
        venv.create(ros_folder(), with_pip=True, clear=is_other)
    command = [str(ros_python()), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *wheels]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        reasons = [line for line in done.stderr.splitlines() if line.startswith("ERROR:")] or [done.stderr.strip()]
        fail(f"pip cannot install the wheels of ROS 2: {reasons[-1].removeprefix('ERROR: ')}")
    return wheels


def requirements(distribution: str) -> list[str]:
    """Return the requirements that are always installed."""
    return [f"{_wheel(distribution, name)}=={version}" for name, version in WHEELS[distribution].items()]


def _wheel(distribution: str, name: str) -> str:
    return f"ros-{distribution}-{name}"


def _has(distribution: str) -> bool:
    """Return whether the environment has wheels of a distribution."""
    return any(ros_folder().glob(f"lib/python*/site-packages/ros_{distribution}_rclpy-*.dist-info"))
