"""The description of a wheel: README.md without its pictures and links, which lead somewhere in a checkout alone."""

import re
from pathlib import Path

from setuptools import setup

README = Path(__file__).with_name("README.md").read_text(encoding="utf-8")

# What is shown once more by an installation: `firm path --docs` prints the folder of the pages.
WITHOUT_PICTURES = re.sub(r"^(!\[.*|<!--.*-->)\n", "", README, flags=re.MULTILINE)

setup(
    long_description=re.sub(r"\[([^]]+)\]\((?!\w+:)([^)#]+)[^)]*\)", r"\1 (`\2`)", WITHOUT_PICTURES),
    long_description_content_type="text/markdown",
)
