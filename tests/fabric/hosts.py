"""Hosts on an Ethernet switch: network namespaces of this test, which end with it."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from ipaddress import IPv4Address
from pathlib import Path

_PROGRAMS = ("unshare", "nsenter", "ip", "mount")
_RIGHTS = [] if os.geteuid() == 0 else ["--user", "--preserve-credentials"]
# Loopback up, no IPv6, no shared memory of other hosts, and the directory of the switch.
_BEGIN = """\
ip link set lo up
echo 1 > /proc/sys/net/ipv6/conf/all/disable_ipv6
mount -t tmpfs tmpfs /dev/shm
echo ready
exec cat
"""


def found(program: str) -> str | None:
    """The path of a program, also of one for administrators, or None."""
    return shutil.which(program) or shutil.which(program, path="/usr/sbin:/sbin")


@dataclass(frozen=True)
class Host:
    """A host: the process that keeps its namespaces, and its address."""

    process: int
    address: str

    def command(self, *words: str) -> list[str]:
        """A command on this host."""
        return ["nsenter", "--target", str(self.process), "--net", "--mount", "--wd", *_RIGHTS, *words]

    def run(self, *words: str) -> None:
        """Run a command on this host, which has to succeed."""
        done = subprocess.run(self.command(*words), capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{words}: {done.stderr}"


@contextmanager
def _namespaces(before: Sequence[str], address: str) -> Iterator[Host]:
    """Namespaces that end when the input of the process that keeps them is closed, at the latest with this one."""
    command = [*before, "unshare", "--net", "--mount", "sh", "-ec", _BEGIN]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as keeper:
        assert keeper.stdin and keeper.stdout
        assert keeper.stdout.readline() == "ready\n"
        yield Host(keeper.pid, address)
        keeper.stdin.close()


@contextmanager
def captured(switch: Host, path: Path) -> Iterator[None]:
    """Write what a switch passes on meanwhile."""
    command = switch.command("dumpcap", "-q", "-i", "switch", "-w", str(path))
    recorder = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert recorder.stderr
    try:
        while not recorder.stderr.readline().startswith("File:"):
            assert recorder.poll() is None
        yield
    finally:
        # It still has something to write.
        recorder.terminate()
        recorder.communicate()


@contextmanager
def switched(count: int) -> Iterator[list[Host]]:
    """A switch, and hosts at it with addresses from 192.0.2.1 on."""
    with ExitStack() as stack:
        as_root = [] if os.geteuid() == 0 else ["unshare", "--map-root-user"]
        switch = stack.enter_context(_namespaces(as_root, ""))
        switch.run("ip", "link", "add", "switch", "type", "bridge", "mcast_snooping", "0")
        switch.run("ip", "link", "set", "switch", "up")
        hosts = [switch]
        for number in range(1, count + 1):
            inside = stack.enter_context(_namespaces(switch.command(), str(IPv4Address("192.0.2.0") + number)))
            _connect(switch, inside, f"port{number}")
            hosts.append(inside)
        yield hosts


def _connect(switch: Host, host: Host, port: str) -> None:
    process = str(host.process)
    switch.run("ip", "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", process)
    switch.run("ip", "link", "set", port, "master", "switch", "up")
    host.run("ip", "address", "add", f"{host.address}/24", "dev", "eth0")
    host.run("ip", "link", "set", "eth0", "up")
    host.run("ip", "route", "add", "224.0.0.0/4", "dev", "eth0")


@functools.cache
def missing() -> str:
    """Why there are no hosts here; empty if there are."""
    lacking = [name for name in _PROGRAMS if not shutil.which(name)]
    if lacking:
        return f"{', '.join(lacking)} not installed"
    try:
        with switched(1):
            return ""
    except (AssertionError, OSError):
        return "no network namespaces here"
