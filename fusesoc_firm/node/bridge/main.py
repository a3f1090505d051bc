"""The ROS process of a Python node, which carries serialised messages between ROS topics and a socket.

The bridge runs under the Python for which ROS is installed. That is rarely the Python that runs this package, so the
bridge is a separate program, which needs only ROS and the standard library of Python 3.8. `node/engine/carrier.py`
starts the bridge.

    python3 bridge SOCKET [ARGUMENT OF ROS ...]         # SOCKET is a file descriptor, a stream of parcels
"""

from __future__ import annotations

import json
import os
import socket
import sys
import threading
import time

from .channel import (
    ANSWER,
    CALL,
    CONFIGURE,
    DIAGNOSTICS,
    FAULT,
    LOG,
    MESSAGE,
    PARAMETERS,
    PUBLISHED,
    STOP,
    Channel,
    unpack_call,
)
from .ros import Ros
from .ros1 import Ros1
from .ros2 import Ros2

_VERSIONS = {1: Ros1, 2: Ros2}


def _serve(ros: Ros, channel: Channel, is_timed: bool) -> None:
    """Carry out the engine's requests until the engine closes its end."""
    while True:
        parcel = channel.receive()
        if parcel is None:
            break
        if parcel.kind == MESSAGE:
            ros.publish(parcel.topic, parcel.data)
            if is_timed and parcel.topic != DIAGNOSTICS:
                channel.send(PUBLISHED, parcel.topic, time_ns=time.monotonic_ns())
        elif parcel.kind == ANSWER:
            ros.answer(parcel.topic, parcel.data)
        elif parcel.kind == CALL:
            ros.call(parcel.topic, *unpack_call(parcel.data))
        elif parcel.kind == PARAMETERS:
            ros.parameters_set(parcel.data)
        elif parcel.kind == LOG:
            ros.log(parcel.topic, parcel.data.decode(errors="replace"))
        elif parcel.kind == STOP:
            ros.stop()
    ros.end()


def main() -> int:
    """Run the bridge."""
    channel = Channel(socket.socket(fileno=int(sys.argv[1])))
    first = channel.receive()
    if first is None or first.kind != CONFIGURE:
        return 2
    config = json.loads(first.data)
    # rospy waits for its master without a time limit; an engine that gives up closes its end.
    ready = threading.Event()
    threading.Thread(target=_give_up, args=(channel, ready), daemon=True).start()
    try:
        ros = _VERSIONS[config["ros"]](config, sys.argv[2:], channel)
    except Exception as error:  # noqa: BLE001 - all exceptions of ROS are reported
        channel.send(FAULT, data=str(error).encode())
        return 1
    ros.ready()
    ready.set()
    server = threading.Thread(target=_serve, args=(ros, channel, config["is_timed"]), daemon=True)
    server.start()
    ros.spin()
    ros.close()
    channel.finish()
    return 0


def _give_up(channel: Channel, ready: threading.Event) -> None:
    """End the process if the engine closes its end before ROS is ready."""
    while not ready.wait(0.2):
        if channel.is_closed():
            os._exit(0)
