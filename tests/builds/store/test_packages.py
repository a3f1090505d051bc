"""The versions of packages are those of Python's own module for metadata."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest

from fusesoc_firm.builds.store.packages import version


@pytest.mark.parametrize("package", ["chevron", "edalize", "fusesoc", "fusesoc-firm", "numpy", "pyyaml", "rosbags"])
def test_the_version_of_a_package(package: str) -> None:
    assert version(package) == metadata.version(package)


def test_a_package_whose_folder_has_no_version_in_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in Debian's packages for Python."""
    (tmp_path / "acme_tool.egg-info").mkdir()
    (tmp_path / "acme_tool.egg-info" / "PKG-INFO").write_text("Metadata-Version: 2.1\nName: acme-tool\nVersion: 1.5\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert version("acme-tool") == "1.5"
    with pytest.raises(metadata.PackageNotFoundError):
        version("acme-missing")
