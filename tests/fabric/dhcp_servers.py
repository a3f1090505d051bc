"""DHCP servers that are not ours, at the switch of a simulated board: dnsmasq and busybox's udhcpd."""

from __future__ import annotations

import subprocess
from contextlib import ExitStack
from pathlib import Path

from tests.fabric.hosts import Host, found

Server = subprocess.Popen[bytes]


def dnsmasq(host: Host, folder: Path, stack: ExitStack, first: str, *options: str, log: str = "dnsmasq") -> Server:
    """Start dnsmasq with one address to give for two minutes."""
    words = [found("dnsmasq") or "dnsmasq", "--no-daemon", "--conf-file=/dev/null", "--port=0"]
    words += ["--interface=eth0", "--bind-dynamic", "--no-ping", "--dhcp-authoritative", "--log-dhcp", "--user=root"]
    words += [f"--dhcp-range={first},{first},2m", f"--dhcp-leasefile={folder / f'{log}.leases'}", "--group="]
    words += [f"--log-facility={folder / f'{log}.log'}", f"--pid-file={folder / f'{log}.pid'}", *options]
    return start(host, words, stack)


def udhcpd(host: Host, folder: Path, stack: ExitStack, first: str, seconds: int) -> Server:
    """Start busybox's udhcpd with one address to give for some seconds."""
    leases, configuration = folder / "udhcpd.leases", folder / "udhcpd.conf"
    leases.touch()
    configuration.write_text(
        f"start {first}\nend {first}\ninterface eth0\nlease_file {leases}\npidfile {folder / 'udhcpd.pid'}\n"
        f"min_lease 1\noption lease {seconds}\noption subnet 255.255.255.0\n",
        encoding="ascii",
    )
    return start(host, ["busybox", "udhcpd", "-f", str(configuration)], stack)


def start(host: Host, words: list[str], stack: ExitStack) -> Server:
    """Start a server, which ends with the stack."""
    server = subprocess.Popen(host.command(*words), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    stack.callback(end, server)
    return server


def end(server: Server) -> None:
    """End a server, as if its host had lost its power."""
    server.kill()
    server.wait()
