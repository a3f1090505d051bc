"""For all tests: an empty store, this Python first on PATH, and no time limit on hypothesis' examples."""

import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

# What an example takes says nothing on a machine that does other things, too.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


def pytest_configure(config: pytest.Config) -> None:
    """A hit in the store would hide what generation no longer does, in a Python that no test had in mind."""
    if hasattr(config, "workerinput"):
        # pytest-xdist's workers inherit the environment.
        return
    store = tempfile.mkdtemp(prefix="fusesoc_firm_")
    config.add_cleanup(lambda: shutil.rmtree(store, ignore_errors=True))
    os.environ["FUSESOC_FIRM_CACHE"] = store
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
