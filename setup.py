"""Builds the wheel's description: README.md without pictures and links, which work only in a checkout."""

import re
from pathlib import Path

from setuptools import setup

README = Path(__file__).with_name("README.md").read_text(encoding="utf-8")

# An installation contains the pages with pictures and links: `firm path --docs` prints their folder.
WITHOUT_PICTURES = re.sub(r"^(!\[.*|<!--.*-->)\n", "", README, flags=re.MULTILINE)

setup(
    long_description=re.sub(r"\[([^]]+)\]\((?!\w+:)([^)#]+)[^)]*\)", r"\1 (`\2`)", WITHOUT_PICTURES),
    long_description_content_type="text/markdown",
)
