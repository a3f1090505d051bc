"""The system of a folder, for commands whose user names no specification and no core."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm.text.diagnostics import fail, nearest_file
from fusesoc_firm.text.outputs import shown

_OTHER_SUFFIXES = (".core", ".vhd", ".vhdl", ".v", ".sv", ".cpp", ".py", ".bag", ".db3", ".mcap")


def spec_here(folder: Path = Path()) -> Path:
    """Return the specification of the only system in a folder. Raise `InputError` unless there is exactly one."""
    from fusesoc_firm.system.message_sources import check_specs_of, specs_in

    check_specs_of(folder)
    return _only(specs_in(folder), folder, "specification of a system", "a specification")


def check_is_spec(path: Path) -> None:
    """Raise `InputError` for a file of another kind, such as a source or a core."""
    if path.is_file() and path.suffix.lower() in _OTHER_SUFFIXES:
        from fusesoc_firm.system.message_sources import specs_in

        names = " or ".join(map(str, specs_in(path.parent)))
        fail(f"{path} is not a specification", hint=f"name {names}" if names else "a specification is a YAML file")


def core_here(folder: Path = Path()) -> Path:
    """Return the core of the only system in a folder that can be simulated; may raise `InputError`."""
    from fusesoc_firm.system.message_sources import cores_in

    return _only(cores_in(folder, "simulation"), folder, ".core file with a system", "a specification or a core")


def _only(paths: Sequence[Path], folder: Path, what: str, named: str) -> Path:
    if len(paths) != 1:
        where = "This folder" if folder == Path() else str(folder)
        names = " or ".join(map(str, paths)) or f"no {what}"
        near = [*sorted(folder.glob("*/fusesoc.conf")), *filter(Path.is_file, [folder / "../fusesoc.conf"])]
        next_step = f"cd {near[0].parent}" if near else "firm init"
        fail(f"which system? {where} has {names}", hint=f"name {named}" + f", or run '{next_step}'" * (not paths))
    return paths[0]


def core_named(system: str | None) -> tuple[str, Path | None]:
    """Return the name of a system's core, and the folder of its file, if known. May raise `InputError`.

    `system` is a specification or a core's file, the folder with one, a core's name, or None for the current folder.
    """
    from fusesoc_firm.builds.setup.core_schema import check_loadable
    from fusesoc_firm.builds.setup.simulation import core_name
    from fusesoc_firm.system.message_sources import check_specs_of, core_of

    path = Path(system or "")
    if not system or any(path.glob("*.core")):
        path = core_here(path)
    elif path.suffix not in (".yaml", ".yml", ".core"):
        if path.is_file():
            fail(f"{path} is neither a specification (.yaml) nor a core (.core)", hint="omit it, or name one of these")
        return str(system), None
    if not path.is_file():
        fail(f"there is no file {path}", hint=nearest_file(path))
    if path.suffix == ".core":
        check_loadable(path)
        return core_name(path), path.parent
    core = core_of(path)
    if core is None:
        check_specs_of(path.parent)
        fail(
            f"no core for {path} is beside it",
            hint=f"write it: firm system core {path}, with --depend CORE for each core that it uses",
        )
    check_loadable(Path(shown(core.path)))
    return str(core.data.get("name", "")), path.parent
