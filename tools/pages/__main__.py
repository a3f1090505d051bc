"""`make pages`: run the console blocks of the pages.

    python -m tools.pages [--update | --install] [PAGE ...]

The exit code is 1 if a page shows something else than its commands print; `--update` writes it into the page. With
`--install`, a page's own commands install the product first, as on a new machine; this needs root and a network.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tools.pages.console import check
from tools.pages.page import Page, pages


def main() -> int:
    """Check or update the pages."""
    parser = argparse.ArgumentParser(prog="tools.pages", description="Run the console blocks of the pages.")
    parser.add_argument(
        "pages", nargs="*", type=Path, metavar="PAGE", help="README.md and all of docs if none is named"
    )
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--update", action="store_true", help="write what the commands print into the pages")
    kind.add_argument("--install", action="store_true", help="begin with the commands that install the product")
    arguments = parser.parse_args()
    chosen = [Page(path.resolve()) for path in arguments.pages] or pages()
    faults = []
    for page in chosen:
        with tempfile.TemporaryDirectory() as folder:
            faults += check(page, Path(folder).resolve(), is_updated=arguments.update, installs=arguments.install)
    print("\n".join(faults) or f"The commands of {len(chosen)} pages print what is shown", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
