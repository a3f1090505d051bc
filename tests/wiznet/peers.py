"""What is on the other side of a chip's connections, on loopback."""

from __future__ import annotations

import socket


def echo(server: socket.socket) -> None:
    """Return to one client what it sends, until it ends."""
    peer, _ = server.accept()
    with peer:
        while data := peer.recv(4096):
            peer.sendall(data)


def free_port() -> int:
    """A port at which nobody listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])
