"""Find `.msg`, `.srv`, `.action` and `.idl` files.

The search covers packages, workspaces of packages, flat folders of packages, and installed ROS distributions.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

from fusesoc_firm.message.bounds import MOST_FILE_BYTES
from fusesoc_firm.message.idl.names import SUFFIX, declared_in
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.text.files import read_regular

# catkin, colcon and ament skip folders with these markers; colcon creates one in `build`, `install` and `log`.
_IGNORE_MARKERS = frozenset({"CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE"})

# The usual folder names of the files; ROS also uses them as suffixes.
_KINDS = tuple(InterfaceKind)
_ROS_SUFFIXES: Mapping[str, InterfaceKind | None] = {**{kind.value: kind for kind in _KINDS}, SUFFIX: None}

InterfaceFiles = dict[InterfaceKind, dict[MessageName, list[Path]]]


def interface_files(folder: Path, suffixes: Mapping[str, InterfaceKind | None] = _ROS_SUFFIXES) -> InterfaceFiles:
    """Return all interface files below a folder, by kind and name; each name maps to all files that define it.

    The suffix of a file determines its kind. An `.idl` file, whose suffix has no kind, declares the names and kinds of
    its interfaces; it is ignored if the package has another file for the same name, from which rosidl generated it.

    A file belongs to the package of the nearest `package.xml` in its parent folders. Without a `package.xml`, the
    package is the folder above `msg/`, `srv/` or `action/` or, in a flat layout, the file's folder. Hidden folders
    (`.git`) and folders with a build tool's ignore marker are skipped.
    """
    found: InterfaceFiles = {kind: {} for kind in _KINDS}
    packages: dict[Path, str] = {}
    for path in _walk(folder, suffixes):
        if path.parent not in packages:
            packages[path.parent] = _package_name(path.parent, folder)
        package, kind = packages[path.parent], suffixes[path.suffix[1:]]
        declared = [(kind, MessageName(package, path.stem))] if kind else _declared(path, package)
        for each, name in declared:
            found[each].setdefault(name, []).append(path)
    for names in found.values():
        for name, paths in names.items():
            names[name] = [path for path in paths if not is_idl(path)] or paths
    return found


def is_idl(path: Path) -> bool:
    """Return whether a file is an `.idl` file by its name."""
    return path.suffix == f".{SUFFIX}"


def _declared(path: Path, package: str) -> list[tuple[InterfaceKind, MessageName]]:
    """Return the interfaces that an `.idl` file declares, or the one that its name suggests."""
    if any(path.with_suffix(f".{kind}").exists() for kind in _KINDS):
        return []  # installed packages have an .idl file for each interface, which need not be read
    kind = next((kind for kind in _KINDS if kind == path.parent.name), InterfaceKind.MESSAGE)
    try:
        text = read_regular(path, MOST_FILE_BYTES).decode(errors="replace")
    except OSError:
        text = ""
    return declared_in(text, package, (kind, MessageName(package, path.stem)))


def ros1_folders(environment: Mapping[str, str]) -> list[Path]:
    """Return the message folders of a sourced ROS 1 in the order of precedence; like ROS, skip missing folders."""
    return [path for path in _entries(environment.get("ROS_PACKAGE_PATH", "")) if path.is_dir()]


def ros2_folders(environment: Mapping[str, str]) -> list[Path]:
    """Return the message folders of a sourced ROS 2 in the order of precedence; skip missing folders."""
    prefixes = _entries(environment.get("AMENT_PREFIX_PATH", ""))
    return [share for prefix in prefixes if (share := prefix / "share").is_dir()]


def _entries(variable: str) -> list[Path]:
    return [Path(entry) for entry in variable.split(os.pathsep) if entry]


def _walk(folder: Path, suffixes: Collection[str]) -> Iterator[Path]:
    """Yield the files in a fixed order. Links are followed, since workspaces contain links, except in cycles."""
    seen: set[str] = set()
    for parent, folders, files in os.walk(folder, followlinks=True):
        real = os.path.realpath(parent)
        if real in seen or (_IGNORE_MARKERS & set(files) and Path(parent) != folder):
            folders.clear()
            continue
        seen.add(real)
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (Path(parent, name) for name in sorted(files) if Path(name).suffix[1:] in suffixes)


def _package_name(parent: Path, folder: Path) -> str:
    """Return the package of the files in `parent`.

    The search for `package.xml` ends at `folder`, which the user named.
    """
    # If the user names the `msg` folder itself, the package is still the folder above.
    top = folder.resolve().parent if folder.resolve().name in _KINDS else folder.resolve()
    # A linked package has the name of its link, so links are kept; `..` is resolved, or the walk would miss `top`.
    start = Path(os.path.abspath(parent))  # noqa: PTH100
    for candidate in (start, *start.parents):
        if name := _declared_name(candidate / "package.xml"):
            return name
        if candidate == top:
            break
    return start.parent.name if start.name in _KINDS else start.name


def _declared_name(manifest: Path) -> str:
    """Return the `<name>` in a `package.xml`, or an empty string if it is missing, as in rosbuild's `manifest.xml`."""
    try:
        return (ET.fromstring(read_regular(manifest, MOST_FILE_BYTES)).findtext("name") or "").strip()
    # ElementTree raises ValueError or LookupError for bad encodings.
    except (OSError, ET.ParseError, ValueError, LookupError):
        return ""
