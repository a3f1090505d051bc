"""The flow of a build with `flow: firm`: that of its generated core or its family, with the target's own options."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from importlib import import_module
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.step.clock_check import checked
from fusesoc_firm.text.diagnostics import nearest
from fusesoc_firm.tools.flows import FAMILIES, FIRM, NETLIST, SUFFIX, Flow, family_flow, read_flow, simulator_flow
from fusesoc_firm.tools.open_flows import OPEN_FLOWS
from fusesoc_firm.tools.simulators import SIMULATORS

# Edalize's flows for boards.
_BOARD_FLOWS = tuple(Flow(name, {"frontends": [NETLIST]}) for name in (*OPEN_FLOWS, "vivado"))
# The clocks of a build in its description, which Edalize does not read.
_CLOCKS = "firm_clocks"


def resolved(api: str, name: str, edam: dict[str, Any], work_root: str) -> tuple[str, str, dict[str, Any]]:
    """Return the interface of Edalize, `flow` or `tool`, with its name and description, that `firm` stands for.

    All other flows and tools are returned as they are. Raise `RuntimeError` if the build does not determine a flow, or
    if the flow does not have one of the options.
    """
    if (api, name) != ("flow", FIRM):
        return api, name, edam
    given = dict(edam.get("flow_options", {}))
    family = given.pop("family", None)
    flow = _generated(edam, Path(work_root)) if family is None else _of_family(str(family), edam)
    options = dict(flow.options)
    for option, value in given.items():
        options[option] = [*options.get(option, ()), *value] if isinstance(value, list) else value
    if unknown := [option for option in given if option not in options_of(flow)]:
        place = f"{flow.name} with {flow.tool}" if flow.tool != flow.name and flow.tool else flow.name
        raise RuntimeError(f"the flow {place} has no option '{unknown[0]}'; {nearest(unknown[0], options_of(flow))}")
    others = {key: value for key, value in edam.items() if key != "flow_options"} | {_CLOCKS: flow.clocks}
    return (
        flow.api,
        flow.name,
        others | ({"tool_options": {flow.name: options}} if flow.is_tool else {"flow_options": options}),
    )


def _generated(edam: dict[str, Any], work_root: Path) -> Flow:
    files = [file["name"] for file in edam.get("files", ()) if file["name"].endswith(SUFFIX)]
    if len(files) != 1:
        reason = "no generated core determines" if not files else "several generated cores determine"
        raise RuntimeError(
            f"{reason} the flow of this target; it needs one generator 'far' with 'board' or a 'product' for a"
            " simulator, or 'flow_options: {family: NAME}'"
        )
    return read_flow((work_root / files[0]).read_text(encoding="utf-8"))


def _of_family(name: str, edam: dict[str, Any]) -> Flow:
    if name not in FAMILIES:
        raise RuntimeError(f"unknown family '{name}'; {nearest(name, FAMILIES)}")
    has_vhdl = any(str(file.get("file_type", "")).startswith("vhdlSource") for file in edam.get("files", ()))
    return family_flow(name, has_vhdl=has_vhdl)


def backend(api: str, name: str, edam: dict[str, Any], work_root: str, *, is_verbose: bool = False) -> Any:
    """Return Edalize's object for a build. May raise `RuntimeError`."""
    made = _class(api, name)
    if clocks := edam.get(_CLOCKS):
        made = checked(made, name, clocks)
    return made(edam=edam, work_root=work_root, verbose=is_verbose)


def options_of(flow: Flow) -> dict[str, Any]:
    """Return Edalize's descriptions of all options that a flow has with the tools in its options."""
    found = _class(flow.api, flow.name)
    if not flow.is_tool:
        return {**found.get_flow_options(), **found.get_tool_options(dict(flow.options))}
    members = found.get_doc(0)
    lists = [{**item, "list": True} for item in members.get("lists", ())]
    return {item["name"]: {"type": "str", **item} for item in (*members.get("members", ()), *lists)}


def known_options() -> dict[str, Any]:
    """Return Edalize's descriptions of the options of all flows that a generated core can determine."""
    return {name: option for flow in reversed([*_flows()]) for name, option in options_of(flow).items()}


def _flows() -> Iterator[Flow]:
    yield from (simulator_flow(name, "", is_system_verilog=False) for name in SIMULATORS)
    yield from (family_flow(name) for name in FAMILIES)
    yield from _BOARD_FLOWS


def _class(api: str, name: str) -> Any:
    if api == "flow":
        found = getattr(import_module(f"edalize.flows.{name}"), name.capitalize())
        # Edalize 0.6.8 merges the options of a build into its flow's table, where the next build would find them.
        return type(found.__name__, (found,), {"_flow": deepcopy(getattr(found, "_flow", {}))})
    from edalize.edatool import get_edatool

    return get_edatool(name)
