"""The pages: their links, lengths and readers, and the check of their console blocks itself."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from tests.hdl.ghdl import REPOSITORY
from tools.pages.console import TESTED_PICTURES, blocks, check
from tools.pages.page import DOCS, Page, pages
from tools.pages.stage import stage

LINES, COLUMNS = 250, 100
# Written by commands; their lines of prose are as long as those of all pages.
GENERATED = [DOCS / "figures", DOCS / "reference" / "licences.md"]
# Followed by beginners, so they are run with the tests; `make pages` runs all pages.
FOLLOWED = [
    "tutorials/first-accelerator.md",
    "tutorials/first-filter.md",
    "tutorials/first-array.md",
    "tutorials/first-accelerator-in-cpp.md",
    "tutorials/first-accelerator-in-python.md",
    "how-to/start-from-a-bag.md",
    "how-to/explore-an-accelerator.md",
    "how-to/port-a-node-to-hardware.md",
    "how-to/when-it-does-not-work.md",
    "how-to/when-python-is-not-hardware.md",
    # It builds a bitstream, which takes minutes.
    pytest.param("how-to/onto-an-icebreaker.md", marks=pytest.mark.thorough),
]


def with_readmes() -> list[Page]:
    """The pages, and those beside cores and demo systems."""
    return [
        *pages(),
        *(Page(path) for room in ("cores", "specs") for path in sorted((REPOSITORY / room).rglob("README.md"))),
    ]


def test_every_link_leads_somewhere() -> None:
    faults = []
    for page in with_readmes():
        for link in page.links:
            if not link.file.exists():
                faults.append(f"{page.name}:{link.line}: there is no {link.file}")
            elif link.anchor and link.anchor not in Page(link.file).anchors:
                faults.append(f"{page.name}:{link.line}: there is no heading {link.anchor} in {link.file}")
    assert faults == []


def test_no_line_and_no_page_is_too_long() -> None:
    assert [f"{page.name}:{line}" for page in pages() for line in page.long_lines(COLUMNS)] == []
    written = [page for page in pages() if not any(place in (page.file, *page.file.parents) for place in GENERATED)]
    assert [page.name for page in written if len(page.text.splitlines()) > LINES] == []


def test_every_file_that_a_page_names_is_there() -> None:
    named = re.compile(r"\b(?:tests|fusesoc_firm|cores|specs|generators)/[\w./-]+\w")
    for page in with_readmes():
        paths = {path for _, inline in page.inlines() for path in named.findall(inline.content)}
        missing = [path for path in paths if not any(REPOSITORY.glob(f"{path}*"))]
        assert missing == [], page.name


def test_errors_and_warnings_are_shown_by_console_blocks() -> None:
    """They run, or say why not; `tests/house` runs the tutorial of a first converter."""
    faults = [
        f"{page.name}:{token.map[0] + 1}"
        for page in pages()
        if page.file.name != "first-converter.md"
        for token in page.tokens
        if token.type in ("fence", "code_block") and token.info != "console" and token.map
        if re.search(r"^(\S+ )?(error|warning): ", token.content, re.MULTILINE)
    ]
    assert faults == []


def test_every_page_says_whom_it_serves_in_its_first_two_lines() -> None:
    for page in pages()[1:]:
        lines = page.first_paragraph.splitlines()
        assert len(lines) == 2, page.name
        assert re.match(r"For .+[.,]$", lines[0]), page.name
        assert re.match(r"After reading it, you can .+\.$", lines[1]), page.name


def test_every_page_is_in_the_navigation_and_in_the_index() -> None:
    settings = tomllib.loads((DOCS / "zensical.toml").read_text(encoding="utf-8"))
    listed = [
        name for item in settings["project"]["nav"] for name in ([item] if isinstance(item, str) else _names(item))
    ]
    assert sorted(listed) == sorted(page.name for page in pages())
    linked = {link.file for page in map(Page, DOCS.rglob("index.md")) for link in page.links}
    assert {page.file for page in pages()} <= linked | {DOCS / "index.md"}


def _names(item: dict[str, list[str]]) -> list[str]:
    (names,) = item.values()
    return names


def test_the_first_screen_of_the_readme() -> None:
    readme = pages()[0]
    assert len(readme.text.splitlines()) <= 120
    (picture,) = (link for link in readme.links if link.is_picture)
    assert picture.line < 15
    commands = [command for block in blocks(readme) for command, _ in block.steps()]
    assert commands[:2] == ["$ make sim", "$ make test"]


def test_every_picture_is_made_by_a_command_of_its_page() -> None:
    for page in pages():
        shown = {link.file.name for link in page.links if link.is_picture} - TESTED_PICTURES
        commands = [command for block in blocks(page) if not block.reason for command, _ in block.steps()]
        made = {Path(path).name for command in commands for path in re.findall(r" -o (\S+)", command)}
        assert shown <= made, page.name


def test_the_source_of_the_site_has_every_file_that_is_linked(tmp_path: Path) -> None:
    stage(tmp_path)
    copies = [Page(path) for path in sorted(tmp_path.rglob("*.md"))]
    assert len(copies) > len(pages())
    assert [link for page in copies for link in page.links if not link.file.exists()] == []


@pytest.mark.check
@pytest.mark.parametrize("name", FOLLOWED)
def test_a_page_for_beginners_prints_what_it_shows(tmp_path: Path, name: str) -> None:
    assert check(Page(DOCS / name), tmp_path) == []


def test_a_tutorial_begins_with_its_installation() -> None:
    """The workspace of the first converter is an existing one, in which a separate test follows it."""
    names = [path for path in sorted((DOCS / "tutorials").glob("*.md")) if path.stem != "first-converter"]
    assert len(names) >= 5
    assert [path.stem for path in names if not next(blocks(Page(path))).installs] == []


def test_the_first_filter_takes_forty_lines_and_three_commands() -> None:
    """Lines that the skeleton already has, blank lines and comments are not typed; each edit of sed is a line."""
    text = (DOCS / "tutorials/first-filter.md").read_text(encoding="utf-8")
    files = "".join(re.findall(r"<!-- file: \S+ -->\n```\w+\n(.*?)```", text, re.DOTALL))
    generated = ("def respond(", '"""Return the responses to one message')
    typed = [line for line in map(str.strip, files.splitlines()) if line and not line.startswith(generated)]
    commands = [command for block in blocks(Page(DOCS / "tutorials/first-filter.md")) for command, _ in block.steps()]
    edits = sum(command.count("-e '") or 1 for command in commands if "sed -i" in command)
    assert len(typed) + edits <= 40
    assert sum("firm " in command for command in commands if "sed -i" not in command) <= 3


PAGE = """\
# Page

<!-- file: words.txt -->
```text
one
two
three
four
five
```

```console
$ wc -l words.txt
5 words.txt
$ cat words.txt; echo took 17.5 s
one
...
three
four
...
took 2 s
```

<!-- not run: it never ends -->
```console
$ sleep infinity
```
"""


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A page whose output is right."""
    monkeypatch.setattr("tools.pages.page.REPOSITORY", tmp_path)
    path = tmp_path / "page.md"
    path.write_text(PAGE, encoding="utf-8")
    return path


def checked(page: Path, *, is_updated: bool = False) -> list[str]:
    folder = page.parent / "scratch"
    folder.mkdir(exist_ok=True)
    return check(Page(page), folder, is_updated=is_updated)


def test_a_page_that_is_right(page: Path) -> None:
    assert checked(page) == []
    assert checked(page, is_updated=True) == []
    assert page.read_text(encoding="utf-8") == PAGE.replace("took 2 s", "took 17.5 s")


@pytest.mark.parametrize(("old", "new"), [("5 words", "6 words"), ("four\n...", "4\n..."), ("two\nthree", "2\nthree")])
def test_a_page_that_shows_something_else_is_found_and_mended(page: Path, old: str, new: str) -> None:
    text = PAGE.replace(old, new, 1)
    page.write_text(text.replace("took 2 s", "took 17.5 s"), encoding="utf-8")
    faults = checked(page)
    if new.startswith("2"):
        # What lies in an elision may change.
        assert faults == []
    else:
        assert any(line.startswith("-" + new.split("\n", maxsplit=1)[0]) for line in faults)
        assert checked(page, is_updated=True) == []
        assert checked(page) == []


def test_a_command_that_fails_without_an_error_is_a_fault(page: Path) -> None:
    page.write_text("```console\n$ false\n```\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match="false: exit status 1"):
        checked(page)


def test_a_page_is_followed_in_one_shell(page: Path) -> None:
    (page.parent / "scratch" / "a").mkdir(parents=True)
    page.write_text(
        "```console\n$ cd a && export WORD=new\n$ echo $WORD; basename $PWD; exit 0\nnew\na\n```\n\n"
        "<!-- in the checkout -->\n```console\n$ ls Makefile\nMakefile\n```\n\n"
        "<!-- file: b.txt -->\n```text\nb\n```\n\n```console\n$ cat ../b.txt\nb\n```\n",
        encoding="utf-8",
    )
    assert checked(page) == []


def test_a_page_begins_with_its_installation_on_request(page: Path) -> None:
    page.write_text(
        "<!-- installs -->\n```console\n$ echo noise; test -f /path/to/checkout/Makefile && export FIRM=there\n```\n\n"
        "```console\n$ echo $FIRM\nthere\n```\n",
        encoding="utf-8",
    )
    folder = page.parent / "scratch"
    folder.mkdir()
    assert check(Page(page), folder, installs=True) == []
    assert "-there" in check(Page(page), folder)


def test_a_picture_that_no_command_makes_is_found(page: Path) -> None:
    page.write_text(
        "![Picture](a.svg)\n\n```console\n$ echo '<text>x</text>' >b.svg # -o b.svg\n```\n", encoding="utf-8"
    )
    assert checked(page) == ["page.md:1: no command of the page makes a.svg"]
    page.write_text(page.read_text(encoding="utf-8").replace("a.svg", "b.svg"), encoding="utf-8")
    (page.parent / "b.svg").write_text("<text>y</text>", encoding="utf-8")
    assert checked(page) == ["page.md:1: b.svg is not what its command makes"]
    assert checked(page, is_updated=True) == []
    assert checked(page) == []


def test_anchors_are_those_of_forges(page: Path) -> None:
    page.write_text("## A `--x` (y)\n\n## One: `a_b:c`\n\n## Twice\n\n## Twice\n", encoding="utf-8")
    assert Page(page).anchors == {"a---x-y", "one-a_bc", "twice", "twice-1"}
