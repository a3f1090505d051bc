"""Edalize's tool `pytest`: runs the test modules of a core as a simulation's target, in the folder of the build.

    flow: sim
    flow_options: {tool: pytest}

The modules are all files of the type `pythonSource` whose names begin with `test_` or end with `_test.py`. Edalize
finds a tool by its file's name, and its packages are namespace packages, so this one can be in another wheel.
"""

from __future__ import annotations

import sys
from pathlib import PurePath
from typing import Any, ClassVar

from edalize.tools.edatool import Edatool
from edalize.utils import EdaCommands

from fusesoc_firm.text.quoting import make_argument


class Pytest(Edatool):  # type: ignore[misc]
    """Runs pytest, whose report `results.xml` shows whether a test ran and passed."""

    description = "Run the test modules of a core with pytest"

    TOOL_OPTIONS: ClassVar[dict[str, dict[str, Any]]] = {
        "pytest_options": {"type": "str", "desc": "Additional options for pytest", "list": True},
    }

    def setup(self, edam: dict[str, Any]) -> None:
        """Add the command that runs the tests."""
        super().setup(edam)
        modules = [file["name"] for file in self.files if file.get("file_type") == "pythonSource"]
        tests = [name for name in modules if PurePath(name).match("test_*.py") or PurePath(name).match("*_test.py")]
        self.edam = {**edam, "files": [file for file in self.files if file["name"] not in modules]}
        self.commands = EdaCommands()
        self.commands.add([], ["modules"], tests)
        command = [make_argument(sys.executable), "-m", "pytest", "-p", "no:cacheprovider", "--junit-xml=results.xml"]
        options = self.tool_options.get("pytest_options", [])
        # Without a module, pytest would collect whatever is in the folder.
        self.commands.add([*command, *options, *map(make_argument, tests or ["no_test_module.py"])], ["run"], [])
        self.commands.set_default_target("modules")

    def run(self) -> tuple[str, list[str], str]:
        """Return the command that runs the tests."""
        return "make", ["run"], self.work_root
