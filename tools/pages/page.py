"""A page of the documentation as its readers see it: links, anchors, pictures, console blocks."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

from tests.hdl.ghdl import REPOSITORY

DOCS = REPOSITORY / "docs"

_PARSER = MarkdownIt("commonmark").enable("table")
_ELSEWHERE = re.compile(r"[a-z]+:")


@dataclass(frozen=True)
class Link:
    """A relative link or picture: its line, the file it leads to and the anchor there, if it names one."""

    line: int
    file: Path
    anchor: str
    is_picture: bool


@dataclass(frozen=True)
class Page:
    """A file of Markdown."""

    file: Path

    @cached_property
    def text(self) -> str:
        """The file's text."""
        return self.file.read_text(encoding="utf-8")

    @cached_property
    def tokens(self) -> list[Token]:
        """The blocks of the page."""
        return _PARSER.parse(self.text)

    @property
    def name(self) -> str:
        """The path in the repository."""
        return self.file.relative_to(REPOSITORY).as_posix()

    @cached_property
    def anchors(self) -> frozenset[str]:
        """The anchors of its headings, as forges and the site make them."""
        headings = [inline.content for token, inline in self.inlines() if token.type == "heading_open"]
        slugs = [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
        repeated = (f"{slug}-{slugs[:n].count(slug)}" for n, slug in enumerate(slugs) if slug in slugs[:n])
        return frozenset([*slugs, *repeated])

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """The links that stay in the repository."""
        return tuple(self._links())

    def _links(self) -> Iterator[Link]:
        for _, inline in self.inlines():
            for token in inline.children or ():
                target = str(token.attrs.get("href") or token.attrs.get("src") or "")
                if target and not _ELSEWHERE.match(target):
                    path, _, anchor = target.partition("#")
                    # Not resolved: a page that a symbolic link shows has its neighbours where the link has them.
                    file = Path(os.path.normpath(self.file.parent / path)) if path else self.file
                    yield Link(_line(inline), file, anchor, token.type == "image")

    @property
    def first_paragraph(self) -> str:
        """What follows the title."""
        return next((inline.content for token, inline in self.inlines() if token.type == "paragraph_open"), "")

    def long_lines(self, length: int) -> Iterator[int]:
        """The numbers of lines beyond `length` columns, apart from those of tables and code, which cannot be broken."""
        unbroken = [
            token.map for token in self.tokens if token.type in ("fence", "code_block", "table_open", "html_block")
        ]
        skipped = {n for begin, end in filter(None, unbroken) for n in range(begin, end)}
        for n, line in enumerate(self.text.splitlines()):
            if len(line) > length and n not in skipped:
                yield n + 1

    def inlines(self) -> Iterator[tuple[Token, Token]]:
        """Each inline token, text outside of code blocks, with the one that opens its block."""
        for before, token in zip(self.tokens, self.tokens[1:], strict=False):
            if token.type == "inline":
                yield before, token


def pages() -> list[Page]:
    """README.md and all pages of docs."""
    return [Page(REPOSITORY / "README.md"), *(Page(path) for path in sorted(DOCS.rglob("*.md")))]


def _line(token: Token) -> int:
    return token.map[0] + 1 if token.map else 1
