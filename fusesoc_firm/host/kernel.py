"""Compiles the C++ of an HLS accelerator to the shared library that simulation calls."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

from fusesoc_firm.diagnostics import fail
from fusesoc_firm.generation import GeneratedFile
from fusesoc_firm.render import render
from fusesoc_firm.system.derived import AcceleratorType
from fusesoc_firm.system.hls import KERNEL_TEMPLATE, SHIM_TEMPLATE, function_name, kernel_configuration, library_name

_COMPILER = "g++"
# Results must not depend on the processor (no contraction to fused operations), nor the file on its build (no
# build id, no symbols that name temporary files).
_FLAGS = (
    "-std=c++17",
    "-O2",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    "-s",
    "-Wl,--build-id=none",
    "-Wno-unknown-pragmas",
)
_CPP_SUFFIXES = (".cpp", ".cc", ".cxx", ".c")


def kernel_files(accelerator: AcceleratorType, folder: Path) -> dict[str, GeneratedFile]:
    """The simulated kernel, and the library that it calls out of the simulator's work folder. Raises `InputError`."""
    configuration = kernel_configuration(accelerator)
    library = library_name(accelerator)
    shim = render(SHIM_TEMPLATE, configuration)
    return {
        f"{function_name(accelerator)}.vhd": GeneratedFile(render(KERNEL_TEMPLATE, configuration), "vhdlSource-93"),
        library: GeneratedFile(_compile(accelerator, folder, shim), "user", copyto=library),
    }


def _compile(accelerator: AcceleratorType, folder: Path, shim: str) -> bytes:
    """The library's bytes: the same for the same sources, wherever they lie."""
    first, *others = accelerator.accelerator.sources
    units = [str((folder / source).resolve()) for source in others if Path(source).suffix in _CPP_SUFFIXES]
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        (place / "kernel.cpp").write_text(shim, encoding="utf-8")
        command = [
            _COMPILER,
            *_FLAGS,
            "-I",
            str((folder / first).resolve().parent),
            "kernel.cpp",
            *units,
            "-o",
            "kernel.so",
        ]
        try:
            result = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
        except FileNotFoundError:
            fail(f"'{_COMPILER}' is needed to simulate '{accelerator.accelerator.name}' and is not installed")
        if result.returncode:
            fail(
                f"the C++ of '{accelerator.accelerator.name}' does not compile:\n{result.stderr.rstrip()}",
                first.source,
                f"expected: {_prototype(accelerator)}",
            )
        return (place / "kernel.so").read_bytes()


def _prototype(accelerator: AcceleratorType) -> str:
    """The function as it must be declared."""
    configuration = kernel_configuration(accelerator)
    inputs = [f"{item['cpp_type']} {item['name']}" for item in configuration["inputs"]]
    outputs = [f"{item['cpp_type']} *{item['name']}" for item in configuration["outputs"]]
    return f"void {function_name(accelerator)}({', '.join(inputs + outputs)})"
