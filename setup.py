"""Builds the wheel's description: README.md without pictures and links, which work only in a checkout."""

import re
import sys
from pathlib import Path

from setuptools import setup

README = Path(__file__).with_name("README.md").read_text(encoding="utf-8")

# An installation contains the pages with pictures and links: `firm path --docs` prints their folder.
WITHOUT_PICTURES = re.sub(r"^(!\[.*|<!--.*-->)\n", "", README, flags=re.MULTILINE)

# pip shows this line only with --verbose, or if the build fails.
PAGE = Path(__file__).parent / "fusesoc_firm" / "studio" / "static" / "index.html"
if "bdist_wheel" in sys.argv and not PAGE.exists():
    print("warning: this wheel has no page for 'firm studio'; 'make studio' builds the page first", file=sys.stderr)

setup(
    long_description=re.sub(r"\[([^]]+)\]\((?!\w+:)([^)#]+)[^)]*\)", r"\1 (`\2`)", WITHOUT_PICTURES),
    long_description_content_type="text/markdown",
)
