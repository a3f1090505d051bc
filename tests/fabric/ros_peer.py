"""rclpy as a peer of a node in fabric; see peer.py."""

from __future__ import annotations

import functools
import importlib
from typing import Any

import rclpy
from peer import DEPTH, FIELDS, run
from rclpy.qos import QoSProfile, ReliabilityPolicy

PACKAGES = {"Point": "geometry_msgs", "Quaternion": "geometry_msgs", "String": "std_msgs", "UInt32": "std_msgs"}
BOARD = "board"


class RosPeer:
    """A node of rclpy, which also waits for the name of the node in fabric."""

    def __init__(self, reads: dict[str, str], writes: dict[str, str], is_reliable: bool) -> None:
        self.reads, self.types = reads, {**reads, **writes}
        rclpy.init()
        self.node = rclpy.create_node("peer")
        kind = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
        quality = QoSProfile(depth=DEPTH, reliability=kind)
        self.came: list[tuple[str, list[Any]]] = []
        self.classes = {
            name: getattr(importlib.import_module(f"{PACKAGES[kind]}.msg"), kind) for name, kind in self.types.items()
        }
        self.writers = {name: self.node.create_publisher(self.classes[name], f"/{name}_in", quality) for name in writes}
        for name in reads:
            take = functools.partial(self.take, name)
            self.node.create_subscription(self.classes[name], f"/{name}_out", take, quality)

    def take(self, name: str, message: Any) -> None:
        self.came.append((name, [getattr(message, field) for field in FIELDS[self.types[name]]]))

    def is_matched(self) -> bool:
        return (
            BOARD in self.node.get_node_names()
            and all(writer.get_subscription_count() for writer in self.writers.values())
            and all(self.node.count_publishers(f"/{name}_out") for name in self.reads)
        )

    def write(self, name: str, values: list[Any]) -> None:
        fields = dict(zip(FIELDS[self.types[name]], values, strict=True))
        self.writers[name].publish(self.classes[name](**fields))

    def poll(self) -> list[tuple[str, list[Any]]]:
        rclpy.spin_once(self.node, timeout_sec=0.005)
        came, self.came = self.came, []
        return came

    def graph(self) -> dict[str, Any]:
        ends = [
            end
            for name in self.types
            for end in (
                *self.node.get_publishers_info_by_topic(f"/{name}_out"),
                *self.node.get_subscriptions_info_by_topic(f"/{name}_in"),
            )
        ]
        facts = [[end.node_name, end.node_namespace, end.topic_type, str(end.topic_type_hash)] for end in ends]
        return {
            "nodes": self.node.get_node_names_and_namespaces(),
            "topics": self.node.get_topic_names_and_types(),
            "ends": facts,
        }

    def end(self) -> None:
        self.node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    run(RosPeer)
