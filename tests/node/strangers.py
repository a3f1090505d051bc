"""Another user's process, which asks a node for its status."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from fusesoc_firm.system.status_frames import read_request

_ASK = """\
import os, socket, sys
os.setuid(65534)
peer = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
peer.connect(b"\\0firm status " + sys.argv[1].encode())
try:
    peer.send(bytes.fromhex(sys.argv[2]))
    print(peer.recv(1000).hex())
except OSError:
    print()
"""


def reply_to_stranger(name: str) -> str:
    """The reply to a request by the user nobody, in hexadecimal digits; only root can be that user."""
    if os.geteuid() != 0:
        pytest.skip("only root can start processes of other users")
    command = [sys.executable, "-c", _ASK, name, read_request(0).hex()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()
