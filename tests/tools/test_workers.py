"""Work on a Dask cluster on loopback: results match those of this machine, and failures end with a message in time."""

from __future__ import annotations

import importlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools import workers
from tests.certificates import needs_openssl, tls_files, write_certificates
from tests.hdl.ghdl import REPOSITORY
from tests.processes import IGNORING_INTERRUPTS

distributed: Any = pytest.importorskip("distributed", reason="no distributed; make test installs it")
dask: Any = pytest.importorskip("dask")

# All tests share the cluster.
pytestmark = pytest.mark.xdist_group("dask")

SMALL_BENCH = ("scheduler", "bench", "--requesters", "2,9", "--policies", "lru,lst", "--sets", "2", "--cycles", "500")

Captured = pytest.CaptureFixture[str]


def _cluster(workers: int) -> Any:
    return distributed.LocalCluster(n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with _cluster(2) as cluster:
        yield cluster.scheduler_address


def _square(number: int) -> int:
    return number * number


def _leave(_: int) -> None:
    os._exit(1)


def test_results_are_those_of_this_machine(address: str, tmp_path: Path, capsys: Captured) -> None:
    tables = []
    for place in (["--cluster", address], ["--jobs", "1"]):
        path = tmp_path / f"{place[0].strip('-')}.csv"
        assert main([*SMALL_BENCH, *place, "--csv", str(path)]) == 0
        tables.append(path.read_text())
    assert tables[0] == tables[1]
    assert len(tables[0].splitlines()) == 1 + 4
    assert "4 evaluations in" in capsys.readouterr().out


def test_every_task_comes_back_once(address: str) -> None:
    numbers = range(100)
    with workers.cluster_workers(address) as cluster:
        assert cluster.count == 2
        assert sorted(cluster.run(_square, numbers)) == [(number, number**2) for number in numbers]


def test_an_address_where_nobody_answers(monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.setattr(workers, "_CONNECT_SECONDS", 1)
    with socket.socket() as bound:
        # The port is bound, but not listening; it is released afterwards, and not reassigned soon.
        bound.bind(("127.0.0.1", 0))
        dead = f"tcp://127.0.0.1:{bound.getsockname()[1]}"
    assert main([*SMALL_BENCH, "--cluster", dead]) == 1
    assert f"error: no Dask scheduler responds at '{dead}'" in capsys.readouterr().err


@pytest.mark.parametrize("nonsense", ["nonsense", "tcp://", "http://127.0.0.1:1", "tcp://127.0.0.1:port"])
def test_an_address_that_is_none(nonsense: str, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.setattr(workers, "_CONNECT_SECONDS", 1)
    assert main([*SMALL_BENCH, "--cluster", nonsense]) == 1
    assert f"error: no Dask scheduler responds at '{nonsense}'" in capsys.readouterr().err


def test_a_cluster_without_workers() -> None:
    with _cluster(0) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(InputError, match=f"'{address}' has no workers"), workers.cluster_workers(address):
            pass


def test_workers_of_another_version(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "__version__", "99.0")
    expected = r"worker tcp://\S+ has \d+\.\d+\.\d+\n      = all workers need fusesoc-firm 99.0"
    with pytest.raises(InputError, match=expected), workers.cluster_workers(address):
        pass


def test_workers_that_die() -> None:
    # The first failure counts: restarting a worker may take very long on a busy machine.
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        _cluster(1) as cluster,
        pytest.raises(InputError, match="was lost"),
        workers.cluster_workers(cluster.scheduler_address) as found,
    ):
        list(found.run(_leave, [1]))


def test_a_scheduler_that_ends() -> None:
    with _cluster(1) as cluster:

        def one_task() -> Iterator[float]:
            yield 300
            # The task has been submitted.
            threading.Thread(target=cluster.close).start()

        with (
            pytest.raises(InputError, match="was lost\n      = the scheduler ended"),
            workers.cluster_workers(cluster.scheduler_address) as found,
        ):
            list(found.run(time.sleep, one_task()))


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("certificates")
    write_certificates(folder)
    return folder


def _configuration(folder: Path, name: str, authority: str) -> Any:
    """Dask's configuration, from one file that is the same on every machine of a cluster."""
    dask: Any = importlib.import_module("dask")
    files = tls_files(folder, name, authority)
    return dask.config.set({f"distributed.comm.tls.{key}": value for key, value in files.items()})


@pytest.fixture(scope="module")
def tls_address(certificates: Path) -> Iterator[str]:
    with _configuration(certificates, "node", "ca"):
        security = distributed.Security(require_encryption=True)
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tls://",
        host="127.0.0.1",
        dashboard_address=":0",
        security=security,
    ) as cluster:
        assert cluster.scheduler_address.startswith("tls://")
        yield cluster.scheduler_address


@needs_openssl
def test_a_cluster_behind_tls(tls_address: str, certificates: Path, capsys: Captured) -> None:
    with _configuration(certificates, "node", "ca"), workers.cluster_workers(tls_address) as cluster:
        assert sorted(cluster.run(_square, range(5))) == [(number, number**2) for number in range(5)]
    assert capsys.readouterr().err == ""


@needs_openssl
@pytest.mark.parametrize(("name", "authority"), [("stranger", "ca"), ("node", "other"), ("stranger", "other")])
def test_a_stranger_gets_and_gives_nothing(
    tls_address: str, certificates: Path, name: str, authority: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cluster rejects the certificate, or is itself rejected."""
    monkeypatch.setattr(workers, "_CONNECT_SECONDS", 1)
    with (
        _configuration(certificates, name, authority),
        pytest.raises(InputError, match=f"no Dask scheduler responds at '{tls_address}'"),
        workers.cluster_workers(tls_address),
    ):
        pass


@needs_openssl
def test_no_plain_connection_gets_into_a_cluster_behind_tls(
    tls_address: str, certificates: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "_CONNECT_SECONDS", 1)
    for address in (tls_address.replace("tls", "tcp"), tls_address.removeprefix("tls://")):
        with (
            _configuration(certificates, "node", "ca"),
            pytest.raises(InputError, match="no Dask scheduler responds at"),
            workers.cluster_workers(address),
        ):
            pass


@needs_openssl
def test_certificates_that_are_missing(certificates: Path, tmp_path: Path) -> None:
    address = "tls://127.0.0.1:1"
    with pytest.raises(InputError, match=r"requires distributed.comm.tls.ca-file\n.*names the certificates"):
        workers.cluster_workers(address).__enter__()
    with (
        _configuration(tmp_path, "node", "ca"),
        pytest.raises(
            InputError,
            match=r"the file '.*/ca.pem', set by distributed.comm.tls.ca-file in Dask's configuration, is missing",
        ),
    ):
        workers.cluster_workers(address).__enter__()


@pytest.mark.parametrize(
    ("address", "is_open"),
    [
        ("tcp://127.0.0.1:1", False),
        ("localhost:1", False),
        ("tcp://[::1]:1", False),
        ("tcp://192.0.2.1:1", True),
        ("192.0.2.1:1", True),
        ("tcp://robot.example:1", True),
    ],
)
def test_a_cluster_that_anyone_may_read_is_warned_of(
    address: str, is_open: bool, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise OSError("nobody")

    monkeypatch.setattr(distributed, "Client", refuse)
    with pytest.raises(InputError, match="no Dask scheduler responds"), workers.cluster_workers(address):
        pass
    err = capsys.readouterr().err
    assert err.startswith(f"warning: '{address}' is neither on this machine nor tls://") if is_open else not err


def test_ctrl_c_ends_it(address: str) -> None:
    """A separate process is interrupted while its work is on the cluster."""
    command = [sys.executable, "-m", "fusesoc_firm.cli", "scheduler", "bench", "--policies", "lst", "--sets", "5"]
    running = subprocess.Popen(
        [*IGNORING_INTERRUPTS, *command, "--requesters", ",".join(map(str, range(2, 65))), "--cluster", address],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with distributed.Client(address) as client, running:
        _wait_until(lambda: any(client.processing().values()))
        running.send_signal(signal.SIGINT)
        out, err = running.communicate()
        assert (running.returncode, out) == (130, "")
        assert err.endswith("interrupted\n") and "Traceback" not in err
        # Submitted tasks are cancelled, so that the cluster is free for others.
        _wait_until(lambda: not any(client.processing().values()))


def _wait_until(is_so: Any) -> None:
    while not is_so():
        time.sleep(0.1)
