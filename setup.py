"""Builds the wheel's description: README.md without pictures and links, which work only in a checkout."""

import re
import sys
from contextlib import suppress
from pathlib import Path

from setuptools import setup

README = Path(__file__).with_name("README.md").read_text(encoding="utf-8")

# An installation contains the pages with pictures and links: `firm path --docs` prints their folder.
WITHOUT_PICTURES = re.sub(r"^(!\[.*|<!--.*-->)\n", "", README, flags=re.MULTILINE)

# pip hides what a build prints, so the line also goes to the terminal, if there is one.
PAGE = Path(__file__).parent / "fusesoc_firm" / "studio" / "static" / "index.html"
if "bdist_wheel" in sys.argv and not PAGE.exists():
    WARNING = "warning: this wheel has no page for 'firm studio'; 'make studio' builds the page first"
    print(WARNING, file=sys.stderr)
    with suppress(OSError), Path("/dev/tty").open("w", encoding="utf-8") as terminal:
        print(f"\n{WARNING}", file=terminal)

setup(
    long_description=re.sub(r"\[([^]]+)\]\((?!\w+:)([^)#]+)[^)]*\)", r"\1 (`\2`)", WITHOUT_PICTURES),
    long_description_content_type="text/markdown",
)
