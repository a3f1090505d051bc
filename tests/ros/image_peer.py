"""A node of rclpy that sends images and a calibration, each when the response to the one before it has come.

    python image_peer.py FOLDER ROWS COLUMNS COUNT

The pixels of image n, in rgb8, are the file n.in of the folder, and those of the response become n.out. The result, as
JSON: the seconds from each publishing call to the callback, the sizes of the last response, and the calibration that
came back.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

import rclpy
from sensor_msgs.msg import CameraInfo, Image

_LONGEST_SECONDS = 60
_AGAIN_SECONDS = 5


class Way:
    """A topic to the node and the one back, for one message at a time."""

    def __init__(self, node: Any, kind: Any, name: str) -> None:
        self.came = threading.Event()
        self.answer: Any = None
        self.at = 0.0
        self.publisher = node.create_publisher(kind, f"/camera/{name}", 10)
        self.subscription = node.create_subscription(kind, f"/resize/{name}", self.take, 10)

    def take(self, message: Any) -> None:
        self.at, self.answer = time.perf_counter(), message
        self.came.set()

    def is_connected(self, node: Any) -> bool:
        return bool(self.publisher.get_subscription_count() and node.count_publishers(self.subscription.topic_name))

    def send(self, message: Any, longest: float) -> float | None:
        """Return the seconds until the response if it comes in time; `answer` is the response."""
        self.came.clear()
        begun = time.perf_counter()
        self.publisher.publish(message)
        return self.at - begun if self.came.wait(longest) else None


def main(folder: Path, rows: int, columns: int, count: int) -> None:
    rclpy.init()
    node = rclpy.create_node("image_peer")
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    images, infos = Way(node, Image, "image_raw"), Way(node, CameraInfo, "camera_info")
    while not (images.is_connected(node) and infos.is_connected(node)):
        time.sleep(0.02)
    info = CameraInfo(height=rows, width=columns, k=[1.5] * 9, p=[-0.25] * 12)
    info.roi.x_offset = 3
    # A node that this one has found may not have found it yet. It finds the images' topic before.
    latest = time.monotonic() + _LONGEST_SECONDS
    while infos.send(info, _AGAIN_SECONDS) is None:
        if time.monotonic() > latest:
            sys.exit("no response")
    seconds = []
    for number in range(count):
        image = Image(height=rows, width=columns, encoding="rgb8", step=3 * columns)
        image.data.frombytes((folder / f"{number}.in").read_bytes())
        taken = images.send(image, _LONGEST_SECONDS)
        if taken is None:
            sys.exit("no response")
        seconds.append(taken)
        (folder / f"{number}.out").write_bytes(images.answer.data.tobytes())
    found, answer = infos.answer, images.answer
    calibration = [found.height, found.width, [*found.k], [*found.p], found.roi.x_offset]
    print(json.dumps([seconds, [answer.height, answer.width, answer.step, answer.encoding], calibration]), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
    # rclpy's thread is still at work.
    sys.stdout.flush()
    os._exit(0)
