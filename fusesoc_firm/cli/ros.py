"""`firm ros install`: ROS 2 for machines without ROS."""

from __future__ import annotations

import argparse
from typing import Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.node.engine.ros_wheels import DEFAULT, WHEELS


def add_ros(commands: Any) -> None:
    """Declare the command."""
    ros = command(commands, "ros", "install ROS 2 for 'firm live' on a machine without ROS", "firm ros install")
    actions = ros.add_subparsers(title="actions", metavar="ACTION", required=True)
    install = command(
        actions,
        "install",
        "install rclpy and message packages as wheels, beside fusesoc-firm, where 'firm live' finds them",
        "firm ros install nav_msgs",
        _install,
    )
    install.add_argument(
        "--distribution",
        choices=sorted(WHEELS),
        default=DEFAULT,
        help=f"the distribution; another one that is installed is replaced (default: {DEFAULT})",
    )
    install.add_argument(
        "packages",
        metavar="PACKAGE",
        nargs="*",
        help="further message packages; std_msgs, geometry_msgs and sensor_msgs are always installed",
    )


def _install(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.node.engine.ros_wheels import install_wheels, ros_python

    for wheel in install_wheels(arguments.packages, arguments.distribution):
        print(wheel)
    print(ros_python())
