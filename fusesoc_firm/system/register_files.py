"""Files for programs and people that use a system's status registers, by PeakRDL's exporters."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.system.hardware.registers import compiled
from fusesoc_firm.system.hardware.status import status_entity
from fusesoc_firm.system.system_core import LoadedSystem, status_text
from fusesoc_firm.text.diagnostics import fail


def write_register_files(loaded: LoadedSystem, folder: Path) -> None:
    """Write the description, a C header, a Python package and an HTML page into a folder.

    Raise `InputError` if the system has no status, or if the exporters are not installed.
    """
    if not loaded.system.status:
        fail(f"system '{loaded.system.name}' has no status", hint="add 'status: frames' to 'project'")
    try:
        from peakrdl_cheader.exporter import CHeaderExporter
        from peakrdl_html import HTMLExporter
        from peakrdl_python.exporter import PythonExporter
    except ImportError as error:
        fail(f"'{error.name}' is not installed", hint="pip install 'fusesoc-firm[registers]'")
    name = status_entity(loaded.system)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.rdl"
    path.write_text(status_text(loaded), encoding="utf-8")
    # An exporter may change the description that it gets.
    CHeaderExporter().export(compiled(path), str(folder / f"{name}.h"))
    PythonExporter().export(  # type: ignore[no-untyped-call]
        compiled(path), str(folder), skip_test_case_generation=True
    )
    HTMLExporter().export(compiled(path), str(folder / f"{name}_page"))
