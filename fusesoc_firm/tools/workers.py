"""Run tasks in processes on this machine, or on the workers of a Dask cluster."""

from __future__ import annotations

import gc
import logging
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib import import_module
from ipaddress import ip_address
from pathlib import Path
from typing import Any, TypeVar

from fusesoc_firm import __version__
from fusesoc_firm.text.diagnostics import fail

Task = TypeVar("Task")
Result = TypeVar("Result")

_CONNECT_SECONDS = 10
# Protocols without authentication.
_OPEN_PROTOCOLS = ("", "tcp", "ws")
# The number of tasks submitted per worker, so that no worker is idle between tasks.
_AHEAD = 4


@dataclass(frozen=True)
class Workers:
    """An executor, and the number of tasks that it runs in parallel."""

    executor: Executor
    count: int

    def run(self, function: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[tuple[Task, Result]]:
        """Yield each task with its result as it finishes; read further tasks only when workers are free."""
        pending: dict[Future[Result], Task] = {}
        for task in tasks:
            pending[self.executor.submit(function, task)] = task
            if len(pending) >= _AHEAD * self.count:
                yield from _finished(pending)
        while pending:
            yield from _finished(pending)


def is_task_wanted() -> bool:
    """Return whether the result of the task that runs in this thread of a worker is still wanted."""
    distributed: Any = import_module("distributed")
    try:
        worker = distributed.get_worker()
        return str(worker.state.tasks[worker.get_current_task()].state) == "executing"
    except (ValueError, KeyError):
        # The scheduler has forgotten the task, or this is not a worker.
        return False


def _finished(pending: dict[Future[Result], Task]) -> Iterator[tuple[Task, Result]]:
    done, _ = wait(pending, return_when=FIRST_COMPLETED)
    for future in done:
        yield pending.pop(future), future.result()


def chosen_workers(jobs: int | None, cluster: str | None) -> AbstractContextManager[Workers]:
    """Return the workers of the Dask cluster at an address or, without an address, processes on this machine."""
    return cluster_workers(cluster) if cluster else local_workers(jobs)


@contextmanager
def local_workers(jobs: int | None = None) -> Iterator[Workers]:
    """Start `jobs` processes on this machine, by default one per processor core, and yield them as workers."""
    count = jobs or len(os.sched_getaffinity(0))
    # Processes are spawned, since a forked copy of a process with threads, such as a progress bar's, may hang.
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(count, mp_context=context, initializer=_leave_interrupts_to_the_parent)
    try:
        yield Workers(executor, count)
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def cluster_workers(address: str) -> Iterator[Workers]:
    """Connect to the Dask cluster whose scheduler is at `address`, such as tls://10.0.0.1:8786; yield its workers.

    Each end of a connection runs code from the other end. With tls://, both ends authenticate each other with the
    certificates in Dask's configuration. Without tls://, a warning is printed unless the scheduler is on this machine.

    Raise `InputError` if the cluster does not respond, has no suitable workers, or if the connection is lost.
    """
    try:
        # Dask's type hints are incomplete.
        distributed: Any = import_module("distributed")
    except ImportError:
        fail("--cluster requires the package 'distributed'", hint="pip install 'fusesoc-firm[cluster]'")
    # A lost connection is reported only here, in one sentence.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    security = _security(distributed, address)
    with _connected(distributed, address, security) as client:
        count = sum(client.ncores().values())
        if not count:
            fail(f"the Dask cluster at '{address}' has no workers", hint=f"start workers: dask worker {address}")
        _check_versions(client, address)
        executor = client.get_executor(pure=False)
        try:
            yield Workers(executor, count)
        except (CancelledError, distributed.KilledWorker) as error:
            fail(
                f"the Dask cluster at '{address}' was lost", hint=" ".join(str(error).split()) or "the scheduler ended"
            )
        finally:
            executor.shutdown(wait=False)


def _security(distributed: Any, address: str) -> Any:
    """Return the security settings for the scheduler's address. Raise `InputError` if certificates are missing."""
    protocol, _, place = address.rpartition("://")
    if protocol != "tls":
        if protocol in _OPEN_PROTOCOLS and not _is_here(place):
            print(
                f"warning: '{address}' is neither on this machine nor tls://: anyone with access to that network can "
                "run programs on all machines of the cluster, including this one",
                file=sys.stderr,
            )
        return distributed.Security()
    security = distributed.Security(require_encryption=True)
    files = {"ca-file": security.tls_ca_file, "client.cert": security.tls_client_cert}
    files |= {"client.key": security.tls_client_key} if security.tls_client_key else {}
    for name, file in files.items():
        if not file:
            hint = (
                "Dask's configuration names the certificates: ca-file, client.cert and client.key "
                "(docs/explanation/security.md)"
            )
            fail(f"'{address}' requires distributed.comm.tls.{name}", hint=hint)
        if not Path(file).is_file():
            fail(f"the file '{file}', set by distributed.comm.tls.{name} in Dask's configuration, is missing")
    return security


def _is_here(place: str) -> bool:
    """Return whether the host in `host:port` is a loopback address."""
    host = place.rpartition(":")[0].strip("[]")
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def _connected(distributed: Any, address: str, security: Any) -> Any:
    """Return a client of the scheduler. Raise `InputError` if the scheduler does not respond."""
    try:
        return distributed.Client(address, timeout=_CONNECT_SECONDS, security=security)
    # Dask raises the last two for an invalid configuration.
    except (OSError, ValueError, RuntimeError, TypeError) as error:
        reason = str(error).split("\n", 1)[0]
    # A discarded client stops its loop when it is garbage-collected. If this happened while another client starts, both
    # would wait for the same lock forever.
    gc.collect()
    return fail(f"no Dask scheduler responds at '{address}'", hint=reason)


def _check_versions(client: Any, address: str) -> None:
    """Raise `InputError` unless the workers have our package versions, since results must be equal on all machines."""
    found = client.run(_version, on_error="return")
    for worker, version in sorted(found.items()):
        if version != __version__:
            has = f"has {version}" if isinstance(version, str) else "cannot import fusesoc-firm"
            fail(
                f"the Dask cluster at '{address}' is not compatible: worker {worker} {has}",
                hint=f"all workers need fusesoc-firm {__version__}",
            )


def _version() -> str:
    return __version__


def _leave_interrupts_to_the_parent() -> None:
    # A handler instead of SIG_IGN, which simulators would inherit: Ctrl-C must end simulators.
    signal.signal(signal.SIGINT, lambda *_: None)
