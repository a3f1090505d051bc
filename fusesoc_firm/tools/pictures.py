"""Graphs as pictures, drawn by Graphviz."""

from __future__ import annotations

import subprocess
from pathlib import Path

from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import check_output, write

# The picture formats, by the ending of the file's name; DOT is Graphviz's own language.
ENDINGS = (".svg", ".png", ".pdf", ".dot")
# The text formats, which can be printed.
TEXTS = ("svg", "dot")


def check_picture(path: Path | None, form: str | None) -> None:
    """Raise `InputError` if `path` is not writable, or if the file's ending contradicts `form`."""
    if path is None:
        return
    check_output(path, ENDINGS)
    if form and path.suffix != f".{form}":
        fail(
            f"the extension of {path} does not match the format {form}",
            hint=f"without --format, the extension determines the format: {', '.join(ENDINGS)}",
        )


def draw(dot: str, path: Path | None, form: str | None, style: str = "") -> None:
    """Write a DOT graph as a picture to `path`, or print the picture in `form`. May raise `InputError`.

    `style` is a style sheet for SVG.
    """
    if path:
        write(path, picture(dot, path.suffix.removeprefix("."), style))
    else:
        print(picture(dot, form or TEXTS[0], style).decode(), end="")


def picture(dot: str, form: str, style: str = "") -> bytes:
    """Return a DOT graph converted to `svg`, `png`, `pdf` or `dot`; `style` is a style sheet for SVG.

    Raise `InputError` if Graphviz is missing.
    """
    if form == "dot":
        return dot.encode()
    drawn = _converted(dot, form)
    if not style or form != "svg":
        return drawn
    return drawn.replace(b"<g id=", f"<style>\n{style}</style>\n<g id=".encode(), 1)


def _converted(dot: str, form: str) -> bytes:
    options = ["-Gdpi=192"] if form == "png" else []
    try:
        return subprocess.run(
            ["dot", f"-T{form}", *options], input=dot.encode(), capture_output=True, check=True
        ).stdout
    except subprocess.CalledProcessError as error:
        fail(f"Graphviz cannot draw the picture as {form}: {error.stderr.decode(errors='replace').strip()}")
    except FileNotFoundError:
        fail("pictures require Graphviz's program 'dot'", hint="on Debian and Ubuntu: apt install graphviz")
