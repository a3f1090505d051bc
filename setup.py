"""The description of a wheel: README.md without the links to pages, which lead somewhere in a checkout alone."""

import re
from pathlib import Path

from setuptools import setup

README = Path(__file__).with_name("README.md").read_text(encoding="utf-8")

# A link to a page becomes its name: `firm path --docs` prints the folder where an installation has it.
setup(
    long_description=re.sub(r"\[([^]]+)\]\((?!\w+:)[^)]+\)", r"`\1`", README),
    long_description_content_type="text/markdown",
)
