"""Run commands of a clean clone in a minimal Debian, and print a table of their results.

    python debian.py SUITE 'COMMAND; COMMAND; ...'

debootstrap builds the minimal system of a suite once, below the user's cache folder. Each call runs the commands in a
new copy of it, one after the other, as root and with the variables of a bare login. Changes that are not committed are
not in the clone. The logs are in build/debian/SUITE. Needs root. The exit status is 1 if a command fails.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SUITES = ("bookworm", "trixie", "forky")
# An older debootstrap has no script for a later suite; all of them link to this one.
SCRIPTS = Path("/usr/share/debootstrap/scripts")
LATEST = "sid"
CHECKOUT = Path("/root/fusesoc_firm")
# Programs and files of `make` itself; all others must come from the commands.
PACKAGES = ("ca-certificates", "git", "make")
# The tools in the table's caption, if the commands have installed them.
TOOLS = ("ghdl-mcode", "iverilog", "verilator", "yosys", "g++", "python3", "qemu-system-arm", "python3-rospy")
LOGIN = {"HOME": "/root", "TERM": "dumb", "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
# A machine behind a proxy, or with its own certificates, needs these for the network.
PROXIES = ("http_proxy", "https_proxy", "ftp_proxy", "no_proxy", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY")
CERTIFICATES = (
    "SSL_CERT_FILE",
    "PIP_CERT",
    "REQUESTS_CA_BUNDLE",
    "CURL_CA_BUNDLE",
    "GIT_SSL_CAINFO",
    "NODE_EXTRA_CA_CERTS",
)
HOST_CERTIFICATES = "/etc/ssl/host-certificates.crt"
# In a separate mount namespace, the copy becomes the root, as on a machine: with chroot, bubblewrap would fail.
ENTER = """
set -eu
mount --bind "$1" "$1"
for name in dev sys; do mount --rbind "/$name" "$1/$name"; done
mount -t proc proc "$1/proc"
mkdir -p "$1/.host"
cd "$1"
pivot_root . .host
umount -l /.host
rmdir /.host
shift
cd "$1"
shift
exec env -i "$@"
"""


@dataclass(frozen=True)
class Result:
    """A finished command: its exit status, its duration in seconds, and its log."""

    command: str
    status: int
    seconds: float
    log: Path

    @property
    def row(self) -> str:
        """The row of the table."""
        result = "passed" if self.status == 0 else f"**failed** (exit status {self.status})"
        minutes, seconds = divmod(round(self.seconds), 60)
        return f"| `{self.command}` | {result} | {minutes}:{seconds:02} | {self.summary} |"

    @property
    def summary(self) -> str:
        """The last lines with the counts of tests or of a simulation."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        counts = re.findall(r"^=+ (.*(?:passed|failed).*?) in [\d.]+s.*=+$|^(PASS \d+/\d+)$", text, re.MULTILINE)
        return "; ".join(tests or simulation for tests, simulation in counts)


def main(arguments: Sequence[str]) -> int:
    """Build the system, run the commands, print the table."""
    suite, commands = arguments[0], [command.strip() for command in arguments[1].split(";")]
    if suite not in SUITES:
        return refuse(f"SUITE is '{suite}'; legal: {', '.join(SUITES)}")
    if os.geteuid() != 0:
        return refuse("only root can build and enter a minimal system: sudo make debian")
    try:
        machine = new_machine(suite)
    except subprocess.CalledProcessError as error:
        return refuse(f"'{shlex.join(map(str, error.cmd))}' failed with exit status {error.returncode}")
    if changed := git("status", "--porcelain", "--untracked-files=no"):
        print(f"Not in the clone, since it is not committed:\n{changed}", flush=True)
    logs = ROOT / "build" / "debian" / suite
    shutil.rmtree(logs, ignore_errors=True)
    logs.mkdir(parents=True)
    results = []
    for number, command in enumerate(commands, 1):
        print(f"{suite}: {command}", flush=True)
        results.append(run(machine, command, logs / f"{number}.log"))
        print(results[-1].row, flush=True)
    print("\n".join(["", *table(suite, machine, results)]))
    return int(any(result.status for result in results))


def refuse(reason: str) -> int:
    """Print why nothing was run."""
    print(f"make debian: {reason}", file=sys.stderr)
    return 1


def git(*arguments: str) -> str:
    """Return what git prints about the checkout."""
    return subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=True).stdout.rstrip()


def new_machine(suite: str) -> Path:
    """Return the folder of a new copy of a suite's minimal system, with a clone of the checkout."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fusesoc_firm" / "debian"
    base, machine, part = cache / suite, cache / f"{suite}.machine", cache / f"{suite}.part"
    cache.mkdir(parents=True, exist_ok=True)
    if not base.exists():
        print(f"Building a minimal {suite} in {base}", flush=True)
        remove(part)
        options = ["--variant=minbase", f"--include={','.join(PACKAGES)}"]
        source = mirror()
        if source and not (SCRIPTS / suite).exists():
            source.append(str(SCRIPTS / LATEST))
        subprocess.run(
            ["debootstrap", *options, suite, part, *source],
            stdout=subprocess.DEVNULL,
            check=True,
        )
        part.rename(base)
    remove(machine)
    subprocess.run(["cp", "--archive", "--reflink=auto", base, machine], check=True)
    give_network(machine)
    subprocess.run(["git", "clone", "--quiet", ROOT, machine / CHECKOUT.relative_to("/")], check=True)
    return machine


def remove(system: Path) -> None:
    """Remove a system. Its mounts have ended with their namespace."""
    if system.exists():
        shutil.rmtree(system)


def mirror() -> list[str]:
    """Return the mirror of this machine's packages, if it is a Debian; otherwise, debootstrap chooses."""
    form = "$(ORIGIN) $(CODENAME) $(REPO_URI)"
    if not shutil.which("apt-get"):
        return []
    printed = subprocess.run(["apt-get", "indextargets", "--format", form], capture_output=True, text=True, check=False)
    suites = re.findall(r"^Debian \w+ (\S+)$", printed.stdout, re.MULTILINE)
    return suites[:1]


def give_network(machine: Path) -> None:
    """Copy this machine's settings for the access to packages."""
    for name in ("resolv.conf", "hosts"):
        shutil.copy(f"/etc/{name}", machine / "etc" / name)
    for settings in Path("/etc/apt/apt.conf.d").glob("*"):
        if "Acquire" in settings.read_text(encoding="utf-8", errors="replace"):
            shutil.copy(settings, machine / "etc" / "apt" / "apt.conf.d" / settings.name)
    if bundles := [os.environ[name] for name in CERTIFICATES if os.environ.get(name)]:
        shutil.copy(bundles[0], machine / HOST_CERTIFICATES.lstrip("/"))


def environment() -> Mapping[str, str]:
    """Return the variables of a bare login, and those for the access to the network."""
    proxies = {name: os.environ[name] for name in PROXIES if name in os.environ}
    return LOGIN | proxies | {name: HOST_CERTIFICATES for name in CERTIFICATES if os.environ.get(name)}


def run(machine: Path, command: str, log: Path) -> Result:
    """Run a command in the clone; all of its processes end with it."""
    enter = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", ENTER, "sh", str(machine)]
    variables = [f"{name}={value}" for name, value in environment().items()]
    begin = time.monotonic()
    with log.open("wb") as file:
        done = subprocess.run(
            [*enter, str(CHECKOUT), *variables, "bash", "-c", command],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            check=False,
        )
    return Result(command, done.returncode, time.monotonic() - begin, log)


def table(suite: str, machine: Path, results: Sequence[Result]) -> list[str]:
    """Return the table of all commands, with the commit and the versions of the tools."""
    form = "--showformat=${Package} ${Version}\\n"
    query = ["dpkg-query", f"--admindir={machine}/var/lib/dpkg", "--show", form, *TOOLS]
    versions = subprocess.run(query, capture_output=True, text=True, check=False).stdout.split("\n")
    installed = ", ".join(line for line in versions if len(line.split()) > 1)
    return [
        f"Commit {git('rev-parse', '--short', 'HEAD')} on a minimal {suite}, {os.cpu_count()} processors: {installed}.",
        "",
        "| command | result | minutes | counts |",
        "|---|---|---|---|",
        *(result.row for result in results),
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
