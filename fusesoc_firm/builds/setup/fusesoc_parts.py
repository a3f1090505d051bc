"""Extensions of FuseSoC's classes for a core and for a generator call, which `libraries` puts in their places.

Loading this module loads FuseSoC, so it is loaded only if FuseSoC is needed.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from fusesoc.capi2.core import CoreInterface
from fusesoc.edalizer import Ttptttg
from fusesoc.vlnv import Vlnv
from okonomiyaki.versions import EnpkgVersion
from simplesat.constraints import PrettyPackageStringParser

from fusesoc_firm.text.file_lock import take
from fusesoc_firm.text.outputs import shown

_LOGGER = logging.getLogger(__name__)
_LONGEST_SHOWN = 40


class SoundCore(CoreInterface):  # type: ignore[misc]
    """A core in which each fault of its file is a `SyntaxError`, after which FuseSoC ignores the file.

    FuseSoC itself does so only for files that violate its schema.
    """

    def __post_init__(self) -> None:
        try:
            super().__post_init__()
            for name in (self.name, *super().get_virtuals({})):
                _check_name(str(name))
        except (SyntaxError, ImportError):
            raise
        except Exception as error:  # any content of a file may cause any exception
            raise SyntaxError(" ".join(str(error).split()) or type(error).__name__) from error

    def get_virtuals(self, flags: Mapping[str, Any] = {}) -> list[Any]:
        """Return the virtual names under these flags; an invalid name that only these flags select is reported."""
        try:
            return [*super().get_virtuals(flags)]
        except SyntaxError as error:
            _warn(f"{shown(Path(self.core_file))}: a name under 'virtual' is ignored: {error.msg}")
            return []

    def get_depends(self, flags: Mapping[str, Any]) -> list[Any]:
        """Return the dependencies. Raise `SyntaxError` also for a version that cannot be compared."""
        depends = [*super().get_depends(flags)]
        for item in depends:
            check_relation(item.depstr())
        return depends

    def get_files(self, flags: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Return the files. Raise `SyntaxError` for a copy out of the build folder."""
        files = [*super().get_files(flags)]
        for item in files:
            if _leads_out(copy := item.get("copyto", "")):
                raise SyntaxError(f"'{copy}' leads out of the build folder, so '{item['name']}' is not copied there")
        return files

    def export(self, dst_dir: str, flags: Mapping[str, Any] = {}) -> None:
        """Copy the files to the folder of the core in a build. Raise `SyntaxError` for a copy out of the build."""
        names = [item["name"] for item in self.get_files(flags) if not Path(item["name"]).is_absolute()]
        for name in names:
            if _leads_out(f"src/{self.name.sanitized_name}/{name}"):
                raise SyntaxError(f"'{name}' of {self.name} would be copied out of the build folder")
        super().export(dst_dir, flags)
        # FuseSoC copies a folder, and then removes its content as that of an earlier build.
        for name in names:
            for source in (Path(root, name) for root in (self.core_root, self.files_root)):
                if source.is_dir():
                    shutil.copytree(source, Path(dst_dir, name), dirs_exist_ok=True)
                    break


def _leads_out(path: str) -> bool:
    """Return whether a path relative to a folder leads out of the folder."""
    return Path(path).is_absolute() or Path(os.path.normpath(path)).parts[:1] == (os.pardir,)


@cache
def _warn(text: str) -> None:
    _LOGGER.warning(text)


@cache
def _check_name(name: str) -> None:
    """Raise `SyntaxError` if FuseSoC's solver rejects a core's name."""
    known = Vlnv(name)
    package = known.vln_str().replace(":", "_").replace("-", "__").lstrip("_")
    try:
        parser = PrettyPackageStringParser(EnpkgVersion.from_string)
        parser.parse_to_package(f"{package} {known.version}-{known.revision}")
    except ValueError as error:
        raise SyntaxError(
            f"'{known.version[:_LONGEST_SHOWN]}' is not a version that FuseSoC can compare, such as 1.0.2"
        ) from error


@cache
def check_relation(depend: str) -> None:
    """Raise `SyntaxError` if a dependency's version cannot be compared."""
    try:
        for simple in Vlnv(depend).simpleVLNVs():
            version(simple)
    except (ValueError, IndexError) as error:
        raise SyntaxError(f"'{depend}' does not have a version that FuseSoC can compare, such as 1.0.2") from error


def version(name: Any) -> Any:
    """Return the version in a core's name, which can be compared with others."""
    return EnpkgVersion.from_string(f"{name.version}-{name.revision}")


class LockedCall(Ttptttg):  # type: ignore[misc]
    """A generator call; only one set-up at a time fills a folder that set-ups share (`cache_type` of the generator).

    FuseSoC regards such a folder as complete. If a set-up was killed while the generator wrote to the folder, the file
    beside the folder is not empty, and the folder is removed.
    """

    def generate(self) -> list[Any]:
        """Return the cores of the call, from the shared folder if it is complete."""
        if not self.is_cacheable():
            return [*super().generate()]
        name = f"{self.vlnv.sanitized_name}-{self._sha256_input_yaml_hexdigest()}"
        folder = Path(self.gen_root, "generator_cache", name)
        folder.parent.mkdir(parents=True, exist_ok=True)
        with folder.with_name(f"{name}.lock").open("a+b") as mark:
            take(mark.fileno())
            if mark.seek(0, os.SEEK_END):
                shutil.rmtree(folder, ignore_errors=True)
            mark.write(b"being written")
            mark.flush()
            try:
                return [*super().generate()]
            finally:
                mark.truncate(0)
