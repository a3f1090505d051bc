"""The processor's counterpart of the hardware: a node of rclpy that doubles images with NumPy, or with OpenCV.

    python3 cpu_node.py [--opencv]

It has the topics of resize.yaml, and ends with Ctrl-C. NumPy gives the bytes of the hardware; those of OpenCV differ
from them by one at most.
"""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import CameraInfo, Image

sys.path.insert(0, str(Path(__file__).parent))
from model import CHANNELS, doubled

DEPTH = 100


def larger_image(image: Image, double: Any) -> Image:
    """Return an image in rgb8 that `double` has made twice as high and wide."""
    rows = np.frombuffer(image.data, np.uint8).reshape(image.height, image.step)
    pixels = double(rows[:, : image.width * CHANNELS].reshape(image.height, image.width, CHANNELS))
    height, width = pixels.shape[:2]
    result = Image(header=image.header, height=height, width=width, encoding="rgb8", step=width * CHANNELS)
    # An array of Python: rclpy checks each element of any other type.
    result.data.frombytes(pixels.tobytes())
    return result


def larger_info(info: CameraInfo) -> CameraInfo:
    """Return the calibration of the larger image, in the received message."""
    info.height, info.width = 2 * info.height, 2 * info.width
    info.k[:6], info.p[:8] = 2 * info.k[:6], 2 * info.p[:8]
    roi = info.roi
    roi.x_offset, roi.y_offset = 2 * roi.x_offset, 2 * roi.y_offset
    roi.height, roi.width = 2 * roi.height, 2 * roi.width
    return info


def with_opencv(pixels: Any) -> Any:
    """Double an image with OpenCV."""
    import cv2

    return cv2.resize(pixels, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)


def main() -> None:
    """Run the node until Ctrl-C."""
    double = with_opencv if "--opencv" in sys.argv[1:] else doubled
    rclpy.init()
    node = rclpy.create_node("resize_on_cpu")
    images = node.create_publisher(Image, "/resize/image_raw", DEPTH)
    infos = node.create_publisher(CameraInfo, "/resize/camera_info", DEPTH)
    node.create_subscription(
        Image, "/camera/image_raw", lambda image: images.publish(larger_image(image, double)), DEPTH
    )
    node.create_subscription(CameraInfo, "/camera/camera_info", lambda info: infos.publish(larger_info(info)), DEPTH)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        # rclpy.spin may miss the wake-up of a Ctrl-C that comes between two of its waits, and then never ends.
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=1)


if __name__ == "__main__":
    main()
