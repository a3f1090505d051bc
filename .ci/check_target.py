"""Print the flow that builds a target of a core, before anything is installed for it.

    python check_target.py CORE TARGET FLOW...

For an unknown core or target, or a target that none of these flows builds, it ends with a list of the known ones.
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from typing import Any

from fusesoc_firm.builds.setup.flows import target_flow
from fusesoc_firm.builds.setup.plan import make_plan
from fusesoc_firm.text.diagnostics import InputError, fail


def check(core: str, target: str, flows: Collection[str]) -> str:
    """The flow of a target, or its tool if it has none. Raises `InputError` if it is none of `flows`."""
    plan = make_plan([core], [target])
    found = plan.fusesoc.get_core(plan.builds[0].core)
    flow_of = {name: _flow(found, name) for name in found.get_data({}).targets}
    if flow_of[target] not in flows:
        fitting = ", ".join(name for name, flow in flow_of.items() if flow in flows)
        fail(
            f"target '{target}' of {found.name} has the flow '{flow_of[target]}', not {' or '.join(flows)}",
            hint=f"its targets with such a flow: {fitting or 'none'}",
        )
    return flow_of[target]


def _flow(core: Any, target: str) -> str:
    flow = target_flow(core, target)
    return flow.name if flow else "None"


if __name__ == "__main__":
    try:
        print(check(sys.argv[1], sys.argv[2], sys.argv[3:]))
    except InputError as error:
        sys.exit(str(error))
