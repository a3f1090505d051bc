"""Cyclone DDS as a peer of a node in fabric; see peer.py."""

import time
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from peer import DEPTH, FIELDS, run


# Annotations are values here, which the library looks up in this module.
@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class UInt32(IdlStruct, typename="std_msgs::msg::dds_::UInt32_"):
    data: uint32


CLASSES: dict[str, type[IdlStruct]] = {"Point": Point, "Quaternion": Quaternion, "String": String, "UInt32": UInt32}


class CyclonePeer:
    """A participant with types of its own, which have no hash."""

    def __init__(self, reads: dict[str, str], writes: dict[str, str], is_reliable: bool) -> None:
        self.types = {**reads, **writes}
        participant = DomainParticipant(0)
        kind = Policy.Reliability.Reliable(duration(seconds=10)) if is_reliable else Policy.Reliability.BestEffort
        quality = Qos(kind, Policy.History.KeepLast(DEPTH))
        self.writers: dict[str, Any] = {}
        self.readers: dict[str, Any] = {}

        def topic(name: str) -> Topic[Any]:
            return Topic(participant, f"rt/{name}", CLASSES[self.types[name.rpartition("_")[0]]], qos=quality)

        for name in writes:
            self.writers[name] = DataWriter(participant, topic(f"{name}_in"), qos=quality)
        for name in reads:
            self.readers[name] = DataReader(participant, topic(f"{name}_out"), qos=quality)

    def is_matched(self) -> bool:
        writers = all(writer.get_matched_subscriptions() for writer in self.writers.values())
        return writers and all(reader.get_matched_publications() for reader in self.readers.values())

    def write(self, name: str, values: list[Any]) -> None:
        self.writers[name].write(CLASSES[self.types[name]](*values))

    def poll(self) -> list[tuple[str, list[Any]]]:
        came = [
            (name, [getattr(sample, field) for field in FIELDS[self.types[name]]])
            for name, reader in self.readers.items()
            for sample in reader.take(100)
        ]
        if not came:
            time.sleep(0.002)
        return came

    def graph(self) -> dict[str, Any]:
        return {}

    def end(self) -> None:
        self.readers.clear()
        self.writers.clear()


if __name__ == "__main__":
    run(CyclonePeer)
