"""Quoted text reads back unchanged in each language's own tool, and nothing in it is executed."""

from __future__ import annotations

import ast
import random
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.text import quoting
from fusesoc_firm.text.render import TEMPLATES, TemplateError, render

# Text with a meaning in one of the languages, and characters that end a line in some.
PIECES = (
    *(
        '"',
        "'",
        "`",
        "\\",
        "\\\\",
        "$",
        "$$",
        "${HOME}",
        "$(touch canary)",
        "[exec touch canary]",
        "{",
        "}",
        "[",
        "]",
        ";",
    ),
    *(
        "--",
        "//",
        "/*",
        "*/",
        "#",
        "%",
        "??/",
        "???",
        "??=",
        "<b>",
        "&amp;",
        "&",
        ">",
        ": ",
        "- ",
        "? ",
        "! ",
        "|",
        ",",
    ),
    *("\\n", "\\x", "\\012", "\\N", "null", "12", "1e3", "{{x}}", " ", "  ", "a", "Z", "é", "ß", "Ω", "‼", "🤖"),
)
LINE_ENDS = ("\f", "\v", "\x85", "\u2028", "\u2029", "\x1c", "\r", "\n", "\t", "\0", "\x7f", "\x1b[2J")


def texts(seed: int, pieces: Sequence[str] = PIECES) -> list[str]:
    """Every piece, alone and at the end, and random sequences of them."""
    some = random.Random(seed)
    return [
        *pieces,
        *(f"end {piece}" for piece in pieces),
        *("".join(some.choices(pieces, k=some.randint(2, 12))) for _ in range(200)),
    ]


def run(command: Sequence[str | Path], folder: Path, text: str | None = None) -> bytes:
    done = subprocess.run(
        [*map(str, command)], cwd=folder, input=text and text.encode(), capture_output=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr.decode()
    assert not (folder / "canary").exists()
    printed: bytes = done.stdout
    return printed


@pytest.mark.parametrize("pieces", [PIECES, (*PIECES, *LINE_ENDS)], ids=["printable", "all"])
def test_a_string_of_python(pieces: Sequence[str]) -> None:
    for text in texts(1, pieces):
        assert ast.literal_eval(quoting.python_string(text)) == text


def test_a_scalar_and_a_list_of_yaml() -> None:
    for text in texts(2, (*PIECES, *LINE_ENDS)):
        scalar = quoting.yaml_scalar(text)
        assert "\n" not in scalar
        assert yaml.safe_load(f"a: {scalar}\nb: 1\n") == {"a": text, "b": 1}
    found = texts(2)
    assert yaml.safe_load(f"a: {quoting.yaml_list(found)}\n") == {"a": found}


def test_a_string_of_c(tmp_path: Path) -> None:
    """With trigraphs, as in compilers for older standards of C."""
    found = [text for text in texts(3, (*PIECES, *LINE_ENDS)) if "\0" not in text]
    strings = "".join(f'    puts({quoting.c_string(text)}); puts("=");\n' for text in found)
    (tmp_path / "strings.c").write_text(
        f"#include <stdio.h>\nint main(void) {{\n{strings}    return 0;\n}}\n", encoding="ascii"
    )
    run(["cc", "-std=c99", "-w", "-o", "strings", "strings.c"], tmp_path)
    assert run(["./strings"], tmp_path).decode() == "".join(f"{text}\n=\n" for text in found)


@pytest.mark.skipif(not shutil.which("tclsh"), reason="tclsh is not installed")
def test_a_word_of_tcl(tmp_path: Path) -> None:
    """As a word of its own, and within a brace-quoted script."""
    found = texts(4, (*PIECES, *LINE_ENDS[:-3]))
    words = "".join(f"puts {quoting.tcl_word(text)}\nputs =\n" for text in found)
    script = f"fconfigure stdout -encoding utf-8 -translation lf\n{words}if {{1}} {{\n{words}}}\n"
    expected = "".join(f"{text}\n=\n" for text in found)
    assert run(["tclsh"], tmp_path, script).decode("utf-8", "surrogatepass").replace("\x00", "") == 2 * expected


def comments(mark: str, line: str) -> str:
    """A line after each comment, which would be missing if a comment swallowed it."""
    return "".join(f"{mark} {quoting.comment(text)}\n{line}\n" for text in texts(5, (*PIECES, *LINE_ENDS)))


def test_a_comment_of_c(tmp_path: Path) -> None:
    text = f"int n;\nvoid f(void) {{\n{comments('//', 'n++;')}}}\n"
    (tmp_path / "comments.c").write_text(text, encoding="ascii")
    shown = run(["cc", "-std=c99", "-w", "-trigraphs", "-E", "-P", "comments.c"], tmp_path)
    assert shown.count(b"n++;") == text.count("\nn++;")


@pytest.mark.skipif(not shutil.which("tclsh"), reason="tclsh is not installed")
def test_a_comment_of_tcl(tmp_path: Path) -> None:
    text = comments("#", "incr n")
    assert run(["tclsh"], tmp_path, f"{text}puts $n\n") == b"%d\n" % text.count("\nincr n")


def test_a_comment_of_vhdl(tmp_path: Path) -> None:
    """Also in VHDL-93, whose comments must not contain UTF-8."""
    lines = comments("  --", "  signal s : bit;").split("\n")
    numbered = "\n".join(line.replace("signal s", f"signal s{number}") for number, line in enumerate(lines))
    text = f"entity e is\nend entity;\narchitecture a of e is\n{numbered}\nbegin\nend architecture;\n"
    (tmp_path / "e.vhd").write_text(text, encoding="ascii")
    run(["ghdl", "-s", "--std=93", "e.vhd"], tmp_path)


@pytest.mark.skipif(not shutil.which("dot"), reason="no dot; make test installs Graphviz")
def test_a_text_of_graphviz(tmp_path: Path) -> None:
    # Graphviz replaces HTML entities.
    found = [text for text in texts(6) if "&" not in text and text.strip() == text and "  " not in text]
    nodes = "".join(f'  n{number} [label="{quoting.dot_text(text)}"]\n' for number, text in enumerate(found))
    svg = ET.fromstring(run(["dot", "-Tsvg"], tmp_path, f"digraph {{\n{nodes}}}\n"))
    shown = [item.text for item in svg.iter("{http://www.w3.org/2000/svg}text")]
    assert [(text or "").replace("\xa0", " ") for text in shown] == found


@pytest.mark.skipif(not shutil.which("dot"), reason="no dot; make test installs Graphviz")
def test_a_text_of_graphviz_in_markup(tmp_path: Path) -> None:
    found = [text for text in texts(6) if text.strip() == text and "  " not in text]
    nodes = "".join(f"  n{number} [label=<<b>{quoting.dot_markup(text)}</b>>]\n" for number, text in enumerate(found))
    svg = ET.fromstring(run(["dot", "-Tsvg"], tmp_path, f"digraph {{\n{nodes}}}\n"))
    shown = [item.text for item in svg.iter("{http://www.w3.org/2000/svg}text")]
    assert [(text or "").replace("\xa0", " ") for text in shown] == found


def test_a_text_of_markup() -> None:
    for name in ("html", "xml"):
        quote = quoting.QUOTES[name]["text"]
        for text in texts(7):
            assert ET.fromstring(f'<a b="{quote(text)}">{quote(text)}</a>').text == text


def test_files_and_arguments_of_make(tmp_path: Path) -> None:
    found = [text for text in dict.fromkeys(texts(8)) if "/" not in text and "\\" not in text and len(text) < 100]
    # Make expands these characters like a shell before it looks for files; none of our names contains them.
    found = [
        text for text in found if not {*text} & {*"?*[]~;|=&'\"`<>()!"} and text.strip() == text and text[0] not in "-#"
    ]
    assert len(found) > 30
    for text in found:
        (tmp_path / text).touch()
    files = " ".join(map(quoting.make_prerequisite, found))
    (tmp_path / "Makefile").write_text(f"all: {files}\n\t@echo done\n", encoding="utf-8")
    assert run(["make", "-s", "-r"], tmp_path) == b"done\n"
    every = [text for text in texts(8) if text.strip()]
    arguments = "".join(f"\t@printf '%s\\n' {quoting.make_argument(text)}\n" for text in every)
    (tmp_path / "Makefile").write_text(f"all:\n{arguments}", encoding="utf-8")
    assert run(["make", "-s", "-r"], tmp_path).decode().split("\n")[:-1] == every


@pytest.mark.skipif(not shutil.which("tclsh"), reason="tclsh is not installed")
def test_templates_name_ways_that_their_language_has(tmp_path: Path) -> None:
    (tmp_path / "a.tcl.mustache").write_text("set a {{word x}} ;# {{comment x}}\n{{#l}}{{word .}} {{/l}}{{{x}}}\n")
    assert render("a.tcl", {"x": "a b", "l": ["$", 1]}, tmp_path) == 'set a "a b" ;# a b\n"\\$" 1 a b\n'
    (tmp_path / "a.vhd.mustache").write_text("{{word x}}\n")
    with pytest.raises(TemplateError, match=r"unknown quoting 'word'; the template's language has comment"):
        render("a.vhd", {"x": "a"}, tmp_path)


def test_no_template_puts_quotes_around_text_that_is_not_quoted() -> None:
    """If a language has a function for quoting strings, only this function writes the quotes."""
    for path in sorted(TEMPLATES.rglob("*.mustache")):
        language = path.name.removesuffix(".mustache").rpartition(".")[2]
        if "string" in quoting.QUOTES.get(language, {}):
            text = path.read_text(encoding="utf-8").replace('#include "{{{source}}}"', "")
            assert not re.search(r'(?<!")"\{\{\{', text), path
