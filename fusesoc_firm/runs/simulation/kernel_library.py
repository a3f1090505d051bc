"""Compile the C++ of an HLS accelerator to the shared library that the simulation calls."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import tempfile
from pathlib import Path
from typing import NoReturn

from fusesoc_firm.core.request import GeneratedFile
from fusesoc_firm.system.derived.cpp_function import kernel_entity, library_name, prototype
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.hardware.hls import kernel, shim
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, fail
from fusesoc_firm.text.outputs import shown
from fusesoc_firm.text.render import Rendering, render
from fusesoc_firm.tools.programs import find

_COMPILER = "g++"
# HLS tools provide their own header of this name.
_STREAM_HEADER = "hls_stream.h"
# Results must not depend on the processor (no contraction to fused operations), and the file must not depend on the
# build (no build id, no symbols that name temporary files).
_FLAGS = (
    "-std=c++17",
    "-O2",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    "-s",
    "-Wl,--build-id=none",
    # Find undefined functions when linking, not when the simulator loads the library.
    "-Wl,-z,defs",
    # List the included files, except system headers.
    "-MMD",
    "-Wno-unknown-pragmas",
)
# Messages are in English, with plain quotation marks.
_ENVIRONMENT = {**os.environ, "LC_ALL": "C"}
# A file name in a rule of make, with its escapes.
_WORD = re.compile(r"(?:\\ |\S)+")
_ESCAPED = re.compile(r"\\([ #])|\$(?=\$)")
_ERROR = re.compile(r"^(?P<file>[^\s:]+):(?P<line>\d+):(?P<column>\d+): (?:fatal )?error: (?P<text>.+)", re.MULTILINE)
# If a brace is missing, the error is in our file, and a note in the user's.
_NOTE = re.compile(r"^(?P<file>[^\s:]+):(?P<line>\d+):(?P<column>\d+): note: (?P<text>to match this .*)", re.MULTILINE)
# Beginnings of the compiler's errors, each with its cure.
_CURES = (
    (r".*: No such file", "put the header beside the source; of the HLS tools' headers, only hls_stream.h is here"),
    (r"cannot convert .* in assignment", "an output is a pointer: write '*name = value;'"),
    (r"invalid conversion from .* to .*\*", "an output is a pointer: write '*name = value;'"),
    (r"to match this", "its counterpart is missing: each '{' needs a '}'"),
    (r"expected '[;}]'|expected .* before", "is a ';', a ')' or a '}' missing before this place?"),
    (
        r".* was not declared in this scope|.* is not a member of 'std'",
        "declare it, correct its name, or include its header, such as <cmath>",
    ),
)
_CPP_SUFFIXES = (".cpp", ".cc", ".cxx", ".c")


def toolchain() -> dict[str, str]:
    """Return the versions of the compiler and the C library, since other versions may be unable to load the library."""
    try:
        shown = subprocess.run([_COMPILER, "--version"], capture_output=True, text=True, check=False).stdout
    except FileNotFoundError:
        shown = ""
    return {_COMPILER: shown.partition("\n")[0], "libc": " ".join(platform.libc_ver())}


def kernel_files(accelerator: AcceleratorType, folder: Path) -> dict[str, GeneratedFile]:
    """Return the simulated kernel, and the library that the kernel loads from the work folder.

    May raise `InputError`.
    """
    library = library_name(accelerator)
    return {
        f"{kernel_entity(accelerator)}.vhd": GeneratedFile(_text(kernel(accelerator)), "vhdlSource-93"),
        library: GeneratedFile(_compile(accelerator, folder, _text(shim(accelerator))), "user", copyto=library),
    }


def check_compiles(accelerator: AcceleratorType, folder: Path) -> None:
    """Raise `InputError` if the C++ does not compile; without a compiler, nothing is known."""
    if find(_COMPILER):
        _compile(accelerator, folder, _text(shim(accelerator)))


def _text(rendering: Rendering) -> str:
    return render(rendering.template, rendering.context)


def _compile(accelerator: AcceleratorType, folder: Path, program: str) -> bytes:
    """Return the library's bytes, which do not depend on the folder of the sources."""
    first, *others = accelerator.accelerator.sources
    name = accelerator.accelerator.name
    units = [str((folder / source).resolve()) for source in others if Path(source).suffix in _CPP_SUFFIXES]
    above = (folder / first).resolve().parent
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        (place / "kernel.cpp").write_text(program, encoding="utf-8")
        (place / _STREAM_HEADER).write_text(render(f"hls/{_STREAM_HEADER}", {}), encoding="utf-8")
        # Without a relative path, `assert` would add the folder's name to the library.
        options = ["-I", str(above), "-I", ".", f"-ffile-prefix-map={folder.resolve()}=.", "-o", "kernel.so"]
        command = [_COMPILER, *_FLAGS, "kernel.cpp", *units, *options]
        try:
            result = subprocess.run(command, cwd=place, capture_output=True, text=True, env=_ENVIRONMENT, check=False)
        except FileNotFoundError:
            fail(f"'{_COMPILER}' is required to simulate '{name}', but is not installed")
        if result.returncode:
            _report(accelerator, folder, result.stderr)
        _check_included(accelerator, folder, place)
        return (place / "kernel.so").read_bytes()


def _report(accelerator: AcceleratorType, folder: Path, output: str) -> NoReturn:
    """Raise `InputError` with the compiler's errors, of which the first one of a line causes the others."""
    first = accelerator.accelerator.sources[0]
    faults, lines = Diagnostics(), set()
    for found in (*_ERROR.finditer(output), *_NOTE.finditer(output)):
        path = folder / found["file"]
        if path.is_file() and (path, found["line"]) not in lines:
            lines.add((path, found["line"]))
            text = path.read_text(encoding="utf-8", errors="replace").splitlines()[int(found["line"]) - 1]
            source = SourceRef(shown(path), int(found["line"]), int(found["column"]), text)
            cure = next((known for pattern, known in _CURES if re.match(pattern, found["text"])), "")
            faults.error(found["text"].replace("to match", "nothing closes"), source, cure)
    faults.raise_if_any()
    message = f"the C++ of '{accelerator.accelerator.name}' does not compile:\n{output.rstrip()}"
    fail(message, first.source, f"expected: {prototype(accelerator)}")


def _check_included(accelerator: AcceleratorType, folder: Path, place: Path) -> None:
    """Check that every included file is a source, since changes to other files would go unnoticed."""
    sources = {(folder / source).resolve() for source in accelerator.accelerator.sources}
    included = {
        (place / _ESCAPED.sub(r"\1", word)).resolve()
        for rules in place.glob("*.d")
        for word in _WORD.findall(rules.read_text(encoding="utf-8").replace("\\\n", " "))[1:]
    }
    missing = sorted(str(path) for path in included - sources if not path.is_relative_to(place.resolve()))
    if missing:
        fail(
            f"'{accelerator.accelerator.name}' includes files that are not sources: {', '.join(missing)}",
            accelerator.accelerator.sources[0].source,
            "list all included files in 'sources', so that changes to these files are noticed",
        )
