"""The reference node as a program on sockets, which returns what it receives:

    python -m tests.fabric.echo_node SPECIFICATION

The message of each subscriber is published by the publisher with the same id. Words as options: `--loss PERCENT` of the
packets each way, seeded by `--seed`. A line on its input is a command: `stop` (with a farewell), `crash`. Prints JSON:
`{"ready": true}`, then the number of peers, of matched endpoints, and of peers that know all endpoints of the node, at
each change, and finally its counts.
"""

from __future__ import annotations

import argparse
import json
import random
import select
import socket
import sys
import time
from pathlib import Path

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node, node_of
from fusesoc_firm.message.library import libraries
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.written.specification import read_specification
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.fabric.participant import Participant
from tests.fabric.participant_tables import DISCOVERY

_PERIOD = 0.01
_BUFFER = 1 << 22


def node_in(specification: Path) -> Node:
    """The node of a specification."""
    faults, known = Diagnostics(), libraries((), None, None)
    written = read_specification(specification, str(specification), faults)
    return node_of(derive(written, specification.parent, known, faults), known)


class Program:
    """Sockets and a clock around the reference."""

    def __init__(self, node: Node, loss: float, seed: int) -> None:
        self._node, self._loss, self._chance = node, loss / 100, random.Random(seed)
        self._took = 0
        self._participant = Participant(node, self._echo)
        domain, address = node.network.domain, str(node.network.address)
        self._sockets = [
            _socket(address, rtps.metatraffic_port(domain)),
            _socket(address, rtps.user_port(domain)),
            _socket(address, rtps.multicast_port(domain), is_group=True),
        ]
        self._told: dict[str, int] = {}

    def _now(self) -> int:
        return int(1000 * time.monotonic())

    def _echo(self, endpoint: Endpoint, payload: bytes) -> None:
        self._took += 1
        writer = self._node.writers[1 + self._node.readers.index(endpoint)]
        self._participant.publish(writer, payload, self._now())

    def _is_lost(self) -> bool:
        return self._chance.random() < self._loss

    def _flush(self) -> None:
        for address, packet in self._participant.outbox:
            if not self._is_lost():
                self._sockets[0].sendto(packet, (address.host, address.port))
        self._participant.outbox.clear()

    def _receive(self, place: socket.socket) -> None:
        packet = place.recv(1 << 16)
        if not self._is_lost():
            self._participant.receive(packet, self._now())
            self._flush()

    def _tell(self) -> None:
        participant = self._participant
        found = {
            "peers": len(participant.peers),
            "matches": len(participant.sources) + len(participant.sinks),
            "knowing": sum(len(peer.acknowledged) == len(DISCOVERY) for peer in participant.peers.values()),
        }
        if found != self._told:
            self._told = found
            print(json.dumps(found), flush=True)

    def run(self) -> None:
        """Run until a command ends it."""
        self._participant.start(self._now())
        print(json.dumps({"ready": True}), flush=True)
        while True:
            ready, _, _ = select.select([*self._sockets, sys.stdin], [], [], _PERIOD)
            if sys.stdin in ready:
                if sys.stdin.readline() != "crash\n":
                    self._participant.leave()
                    self._flush()
                break
            for place in self._sockets:
                if place in ready:
                    self._receive(place)
            self._participant.tick(self._now())
            self._flush()
            self._tell()
        print(json.dumps({"took": self._took, "counts": self._participant.counts}), flush=True)


def _socket(address: str, port: int, *, is_group: bool = False) -> socket.socket:
    """A socket for one port; those for the group hear what is sent to it through the interface with this address."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
    made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
    made.bind((rtps.MULTICAST if is_group else address, port))
    if is_group:
        group = socket.inet_aton(rtps.MULTICAST) + socket.inet_aton(address)
        made.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
    return made


def main() -> None:
    """Read the options and run."""
    parser = argparse.ArgumentParser()
    parser.add_argument("specification", type=Path)
    parser.add_argument("--loss", type=float, default=0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    Program(node_in(options.specification), options.loss, options.seed).run()


if __name__ == "__main__":
    main()
