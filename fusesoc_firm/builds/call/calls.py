"""Convert FuseSoC's call of a generator to a request with checked parameters."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import yaml

from fusesoc_firm.builds.call.parameters import Parameter, check_parameters
from fusesoc_firm.builds.call.requesting_core import find_requesting_core
from fusesoc_firm.core.request import CoreFolders, GeneratorCall, MessageFolders, Request
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, fail
from fusesoc_firm.text.yaml_text import data_in


def read_call(path: Path, generator: str = "") -> GeneratorCall:
    """Read a call from FuseSoC's file, which does not name the generator. May raise `InputError`."""
    try:
        call = data_in(path)
        return GeneratorCall(generator, str(call["vlnv"]), str(Path(call["files_root"])), call.get("parameters") or {})
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError) as error:
        fail(f"{path} is not a FuseSoC generator call: {error}")


def make_request(call: GeneratorCall, parameters: Iterable[Parameter], find: CoreFolders) -> Request:
    """Return the request of a call; `find` locates the folders of its message cores. May raise `InputError`."""
    folder = Path(call.files_root)
    origin = find_requesting_core(folder, call.vlnv.split(":")[2])
    checked = check_parameters(call.parameters, parameters, origin)
    places = {name: origin.items(name, value) for name, value in checked.items() if isinstance(value, list)}
    for name in call.parameters.keys() - places.keys():
        places[name] = [place for place in [origin.value(name, checked[name])] if place]
    request = Request(call.generator, call.vlnv, folder, checked, places, MessageFolders(find))
    faults = Diagnostics()
    for name, source in request.listed("messages").items():
        try:
            request.message_folders.of({name: source})
        except InputError as error:
            faults.take(error, source)
    faults.raise_if_any()
    return request
