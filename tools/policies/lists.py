"""The parts of cores/sched that derive from the table of policies: `make policies` writes them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import yaml

from fusesoc_firm.scheduling.policies import POLICIES, Policy
from fusesoc_firm.system.hardware.maps import port_map
from fusesoc_firm.text.render import render

_FOLDER = Path(__file__).parent
_TYPE = re.compile(r"(?<=type policy_t is \().*?(?=\);)", re.DOTALL)
_DEPEND = re.compile(r"( +- ~robot:sched:)firm_sched_\w+(:\S+\n)(?:\1\w+\2)*")


def files(sched: Path) -> dict[Path, str]:
    """The files in cores/sched that list the policies, and the core of a policy that has none, with their texts."""
    package, core = sched / "rtl/firm_sched_pkg.vhd", sched / "policies.core"
    text = _TYPE.sub(", ".join(POLICIES).upper(), package.read_text(encoding="ascii"))
    for rule in ("has_deadlines", "has_transfer_times"):
        cases = [f"policy = {name.upper()}" for name, policy in POLICIES.items() if getattr(policy, rule)]
        text = re.sub(rf"(?<=return ).*(?=;\n  end function {rule};)", " or ".join(cases), text)
    depend = "".join(rf"\1{entity}\2" for entity in dict.fromkeys(policy.entity for policy in POLICIES.values()))
    context = {"policies": [_instance(policy) for policy in POLICIES.values()]}
    return {
        package: text,
        core: _DEPEND.sub(depend, core.read_text(encoding="ascii")),
        sched / "rtl/firm_sched_by_policy.vhd": render("by_policy.vhd", context, _FOLDER),
        **dict(_missing_cores(sched, core)),
    }


def _missing_cores(sched: Path, listing: Path) -> Iterator[tuple[Path, str]]:
    version = yaml.safe_load(listing.read_text(encoding="ascii"))["name"].rpartition(":")[2]
    for policy in POLICIES.values():
        path = sched / f"{policy.core_file}.core"
        if not path.exists():
            context = {"entity": policy.entity, "title": policy.title, "version": version}
            yield path, render("policy.core", context, _FOLDER)


def _instance(policy: Policy) -> dict[str, object]:
    values = {"PREEMPTIVE": "true"}
    generics = port_map((name, values.get(name, name)) for name in ("REQUESTERS", *policy.generics))
    return {"name": policy.name, "literal": policy.name.upper(), "entity": policy.entity, "generics": generics}
