"""A content-addressed store of generated files, so that nothing is generated twice.

FuseSoC's own generator cache cannot be used: it sees neither the code nor the templates that a core is made with,
keeps partial output after an interrupt, and is not locked. Here an entry's key covers all that decides its content. An
entry is filled in a temporary folder and appears by one rename; each file is checked against a manifest before it is
used; and the files are handed out as bytes, so that no other process can change or remove them in between.

    <root>/v1/<first two digits of key>/<key>/manifest.json     SHA-256 of each file
    <root>/v1/<first two digits of key>/<key>/files/<name>
    <root>/v1/<first two digits of key>/<key>.lock              held while the entry is made
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

Files = Mapping[str, bytes]
"""Contents by file name; a name may hold `/`."""

_PACKAGE = Path(__file__).resolve().parent
# What generated text can depend on beside our own code.
_IMPORTED = ("chevron", "pyyaml", "rosbags")
_LAYOUT = "v1"


@dataclass(frozen=True)
class Entry:
    """Generated files and whether they were found (True) or had to be made (False)."""

    files: Files
    is_from_store: bool


@dataclass(frozen=True)
class Store:
    """A store in the folder `root`, which is made when it is first written to."""

    root: Path

    def obtain(self, key: str, build: Callable[[], Files]) -> Entry:
        """The files of `key`, from the store if it has them undamaged, else from `build`, which are then kept.

        Processes that want the same key at once wait for the first of them. Whatever `build` raises passes through, and
        nothing is kept. If the store cannot be written, one line on stderr says so and the files are made without it.
        """
        folder = self.root / _LAYOUT / key[:2] / key
        if (files := _read(folder)) is not None:
            return Entry(files, True)
        with self._lock(folder) as is_writable:
            # While this process waited for the lock another one may have made the entry.
            if (files := _read(folder)) is not None:
                return Entry(files, True)
            files = build()
            if is_writable:
                self._keep(folder, files)
        return Entry(files, False)

    @contextmanager
    def _lock(self, folder: Path) -> Iterator[bool]:
        """Hold the entry's lock, which the system frees if the process dies; False where there can be none."""
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            file = folder.with_name(f"{folder.name}.lock").open("w")
        except OSError as error:
            self._warn(error)
            yield False
            return
        with file:
            # A file system without locks costs a second build at worst: entries appear by renaming.
            with suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_EX)
            yield True

    def _keep(self, folder: Path, files: Files) -> None:
        try:
            temporary = Path(tempfile.mkdtemp(prefix=".new-", dir=folder.parent))
            try:
                _write(temporary, files)
                # What is there now was found damaged.
                shutil.rmtree(folder, ignore_errors=True)
                temporary.rename(folder)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
        except OSError as error:
            self._warn(error)

    def _warn(self, error: OSError) -> None:
        print(f"warning: nothing is kept in the store {self.root}: {error.strerror}", file=sys.stderr)


def default_root(environment: Mapping[str, str] = os.environ) -> Path:
    """FUSESOC_FIRM_CACHE, else `fusesoc_firm` in XDG_CACHE_HOME, else in ~/.cache."""
    if chosen := environment.get("FUSESOC_FIRM_CACHE"):
        return Path(chosen).expanduser().absolute()
    base = environment.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser().absolute() / "fusesoc_firm"


def store_key(request: Mapping[str, object], inputs: Mapping[str, bytes | None]) -> str:
    """The key of what `request` (plain data) makes of `inputs`: the bytes of each file by name, None if there is none.

    It covers this package's code and templates and the versions of what they use, too.
    """
    parts = {
        "request": request,
        "inputs": {name: None if data is None else _digest(data) for name, data in inputs.items()},
        "code": package_digest(),
        "versions": {name: version(name) for name in _IMPORTED},
        "python": sys.version_info[:2],
        # What a compiler made of an accelerator runs on one kind of machine only.
        "machine": platform.machine(),
    }
    return _digest(json.dumps(parts, sort_keys=True).encode())


@cache
def package_digest() -> str:
    """The digest of every module and template of this package."""
    return folder_digest(_PACKAGE)


def folder_digest(package: Path) -> str:
    """The digest of names and contents of all `*.py` and `templates/**` in a package's folder, its library left out."""
    found = {path for pattern in ("**/*.py", "templates/**/*") for path in package.glob(pattern) if path.is_file()}
    names = sorted(path.relative_to(package).as_posix() for path in found)
    digests = {name: _digest((package / name).read_bytes()) for name in names if not name.startswith("library/")}
    return _digest(json.dumps(digests).encode())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _write(folder: Path, files: Files) -> None:
    for name, data in files.items():
        path = folder / "files" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    manifest = {"files": {name: _digest(data) for name, data in files.items()}}
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1))


def _read(folder: Path) -> Files | None:
    """The files of an entry, in the order they were made, or None if it is not there or not whole."""
    try:
        digests = dict(json.loads((folder / "manifest.json").read_bytes())["files"])
        files = {name: (folder / "files" / name).read_bytes() for name in digests}
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return files if all(_digest(data) == digests[name] for name, data in files.items()) else None
