"""`firm cache`: the stores of generated cores and of steps' results, also as a server for other machines."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command, natural
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.builds.step.results import Results
    from fusesoc_firm.builds.store.store import Store

_UNIT = 1024
_CORES, _RESULTS, _SERVED = "cores", "results", "served"
_SERVED_LIMIT = "10G"


def add_cache(commands: Any) -> None:
    """Declare the command and its actions."""
    cache = command(commands, "cache", "show, clean, verify or serve stored cores and results", "firm cache show")
    actions = cache.add_subparsers(title="actions", metavar="ACTION", required=True)
    show = command(
        actions, "show", "print the store's folder and its contents", "firm cache show --entries", _show_cache
    )
    show.add_argument("--entries", action="store_true", help="also list the generated cores, the last used first")
    clean = command(
        actions,
        "clean",
        "remove generated cores and results, including those of earlier versions; concurrent runs are not disturbed",
        "firm cache clean --to 200M",
        _clean_cache,
    )
    clean.add_argument(
        "--to",
        type=_size,
        metavar="SIZE",
        help="remove the least recently used entries until each store is at most SIZE, such as 200M",
    )
    clean.add_argument(
        "--only",
        choices=(_CORES, _RESULTS, _SERVED),
        help="generated cores, results of steps, or what other machines have written to 'firm cache serve'",
    )
    command(
        actions,
        "verify",
        "compare every entry with its digest, and remove damaged entries",
        "firm cache verify",
        _verify_cache,
    )
    serve = command(
        actions,
        "serve",
        "serve the store to other machines, as a remote store; clients with the token in FUSESOC_FIRM_REMOTE_TOKEN may"
        " write",
        "FUSESOC_FIRM_REMOTE_TOKEN=... firm cache serve --host 10.0.0.1",
        _serve_cache,
    )
    serve.add_argument(
        "--host", default="127.0.0.1", help="the address to listen on; 0.0.0.0 for all (default: this machine only)"
    )
    serve.add_argument(
        "--limit",
        type=_size,
        default=_SERVED_LIMIT,
        metavar="SIZE",
        help=f"the limit of what is served, of which the least recently used is removed (default: {_SERVED_LIMIT})",
    )
    serve.add_argument("--port", type=natural, default=8099, help="the port; 0 for any free one (default: 8099)")


def _size(text: str) -> int:
    from fusesoc_firm.builds.store.limited import parse_size

    if (size := parse_size(text)) is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a size; legal: a number of bytes, such as 4096, 500M or 2G")
    return size


def _show_cache(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.builds.step.results import default_results
    from fusesoc_firm.builds.store.layout import read_entry
    from fusesoc_firm.builds.store.store import default_store, served_store

    store = default_store()
    results, served = default_results(), served_store(0)
    entries = store.entries()
    print(f"folder   {store.root}")
    print(f"entries  {len(entries)}")
    print(f"size     {_shown(store.size())} of {_shown(store.limit)}")
    print(f"results  {results.number()}")
    print(f"size     {_shown(results.size())} of {_shown(results.limit)}")
    if size := served.size():
        print(f"served   {_shown(size)}")
    if not store.is_writable():
        print("rights   read-only: new results are not cached")
    if store.remote:
        print(f"remote   {store.remote.url}, {'read and write' if store.remote.is_writable else 'read-only'}")
    for file in entries if arguments.entries else ():
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(file.used))
        entry = read_entry(str(store.root), file.name)
        about = "  ".join(entry[0].get(key, "") for key in ("generator", "core")) if entry else "damaged"
        print(f"{used}  {_shown(file.size):>10}  {about}")


def _clean_cache(arguments: argparse.Namespace) -> None:
    removed = 0
    stores = _stores()
    for store in [stores[arguments.only]] if arguments.only else stores.values():
        try:
            removed += store.clean() if arguments.to is None else store.shrink(arguments.to)
        except OSError as error:
            fail(f"cannot clean {store.root}: {error.strerror}")
    print(f"{_shown(removed)} removed from {stores[_CORES].root}")


def _verify_cache(_: argparse.Namespace) -> None:
    damaged = []
    stores = _stores()
    for store in stores.values():
        try:
            damaged += store.remove_damaged()
        except OSError as error:
            fail(f"cannot remove a damaged entry from {store.root}: {error.strerror}")
    if damaged:
        files = "\n".join(map(str, damaged))
        entries = "1 entry was" if len(damaged) == 1 else f"{len(damaged)} entries were"
        fail(f"{entries} damaged and removed:\n{files}")
    print(f"{stores[_CORES].root}: all entries are intact")


def _serve_cache(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.builds.store.remote import TOKEN
    from fusesoc_firm.builds.store.server import Server
    from fusesoc_firm.builds.store.store import served_store

    token = os.environ.get(TOKEN, "")
    try:
        server = Server(served_store(arguments.limit), arguments.host, arguments.port, token)
    except (OSError, OverflowError) as error:
        fail(f"cannot listen on {arguments.host} port {arguments.port}: {getattr(error, 'strerror', None) or error}")
    rights = "clients with the token may write" if token else f"read-only; {TOKEN} lets clients with this token write"
    print(f"{server.url} serves {server.store.root}; {rights}", flush=True)
    with server:
        server.serve_forever()


def _stores() -> Mapping[str, Store | Results]:
    from fusesoc_firm.builds.step.results import default_results
    from fusesoc_firm.builds.store.store import default_store, served_store

    return {_CORES: default_store(), _RESULTS: default_results(), _SERVED: served_store(0)}


def _shown(size: float) -> str:
    """Return a number of bytes as a readable text with a unit."""
    if size < _UNIT:
        return f"{size} bytes"
    for unit in ("KiB", "MiB", "GiB"):
        size /= _UNIT
        if size < _UNIT:
            return f"{size:.1f} {unit}"
    return f"{size / _UNIT:.1f} TiB"
