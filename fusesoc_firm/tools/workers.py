"""Who does the work: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import gc
import logging
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
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
# Without proof of who is at the other end.
_OPEN_PROTOCOLS = ("", "tcp", "ws")
# Tasks handed out for each worker, so that none waits for the next one.
_AHEAD = 4


@dataclass(frozen=True)
class Workers:
    """An executor, and how many tasks it does at once."""

    executor: Executor
    count: int

    def run(self, function: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[tuple[Task, Result]]:
        """Each task with its result, as they come; tasks are taken from their source only when there is room."""
        pending: dict[Future[Result], Task] = {}
        for task in tasks:
            pending[self.executor.submit(function, task)] = task
            if len(pending) >= _AHEAD * self.count:
                yield from _finished(pending)
        while pending:
            yield from _finished(pending)


def _finished(pending: dict[Future[Result], Task]) -> Iterator[tuple[Task, Result]]:
    done, _ = wait(pending, return_when=FIRST_COMPLETED)
    for future in done:
        yield pending.pop(future), future.result()


@contextmanager
def local_workers(jobs: int | None = None) -> Iterator[Workers]:
    """Processes of this machine, one a core unless `jobs` says how many."""
    count = jobs or len(os.sched_getaffinity(0))
    # Started anew: a copy of a process that has threads (a progress bar's) may hang.
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(count, mp_context=context, initializer=_leave_interrupts_to_the_parent)
    try:
        yield Workers(executor, count)
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def cluster_workers(address: str) -> Iterator[Workers]:
    """The workers of the Dask cluster whose scheduler is at `address`, such as tls://10.0.0.1:8786.

    Both ends of a connection run what the other one sends. With tls:// they know each other by certificates, those of
    Dask's own configuration; without, what is neither of this machine is warned of.

    Raises `InputError` if none answers, if it has no workers or its workers cannot do our tasks, and if it is lost.
    """
    try:
        # Its types are partial.
        distributed: Any = import_module("distributed")
    except ImportError:
        fail("--cluster needs the package 'distributed'", hint="pip install 'fusesoc-firm[cluster]'")
    # What is lost is told here, once and in a sentence.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    security = _security(distributed, address)
    with _connected(distributed, address, security) as client:
        count = sum(client.ncores().values())
        if not count:
            fail(f"the Dask cluster at '{address}' has no workers", hint=f"start some: dask worker {address}")
        _check_versions(client, address)
        executor = client.get_executor(pure=False)
        try:
            yield Workers(executor, count)
        except (CancelledError, distributed.KilledWorker) as error:
            fail(
                f"the Dask cluster at '{address}' was lost", hint=" ".join(str(error).split()) or "its scheduler ended"
            )
        finally:
            executor.shutdown(wait=False)


def _security(distributed: Any, address: str) -> Any:
    """What a connection to the scheduler is to prove. Raises `InputError` if certificates are missing."""
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
            fail(f"'{address}' needs distributed.comm.tls.{name}", hint=hint)
        if not Path(file).is_file():
            fail(f"the file '{file}' of distributed.comm.tls.{name} in Dask's configuration is missing")
    return security


def _is_here(place: str) -> bool:
    """Whether the host of `host:port` is this machine's loopback."""
    host = place.rpartition(":")[0].strip("[]")
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def _connected(distributed: Any, address: str, security: Any) -> Any:
    """A client of the scheduler. Raises `InputError` if none answers."""
    try:
        return distributed.Client(address, timeout=_CONNECT_SECONDS, security=security)
    # The last two: what Dask's configuration refuses.
    except (OSError, ValueError, RuntimeError, TypeError) as error:
        reason = str(error).split("\n", 1)[0]
    # What is left of the client ends its loop when it is collected. If that came while another one begins, both would
    # wait for the same lock for ever.
    gc.collect()
    return fail(f"no Dask scheduler answers at '{address}'", hint=reason)


def _check_versions(client: Any, address: str) -> None:
    """The workers must have what we have: results are to be the same wherever they come from."""
    found = client.run(_version, on_error="return")
    for worker, version in sorted(found.items()):
        if version != __version__:
            has = f"has {version}" if isinstance(version, str) else "cannot import it"
            fail(
                f"the Dask cluster at '{address}' cannot do this: its worker {worker} {has}",
                hint=f"all workers need fusesoc-firm {__version__}",
            )


def _version() -> str:
    return __version__


def _leave_interrupts_to_the_parent() -> None:
    # A handler, not SIG_IGN: that one the simulators would inherit, but Ctrl-C shall end them.
    signal.signal(signal.SIGINT, lambda *_: None)
