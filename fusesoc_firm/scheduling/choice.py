"""`firm scheduler choose`: present the choice of a scheduler as text or as data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fusesoc_firm.scheduling.analysis import Analysis, Choice, end_of
from fusesoc_firm.scheduling.tables import UNKNOWN, grid
from fusesoc_firm.text.json_text import json_text
from fusesoc_firm.text.yaml_text import yaml_dump


def show(choice: Choice, form: str, more: Mapping[str, Any]) -> str:
    """Return the choice as "text", "yaml" or "json", with a final newline; data also has `more` keys."""
    if form == "text":
        return _text(choice)
    data = {**as_data(choice), **more}
    if form == "json":
        return json_text(data, 1) + "\n"
    return yaml_dump(data)


def as_data(choice: Choice) -> dict[str, Any]:
    """Return the choice as plain data; a missing bound is None."""
    return {
        "scheduler": choice.best.policy,
        "criterion": str(choice.criterion),
        "utilisation": round(choice.utilisation, 6),
        "reasons": list(choice.reasons),
        "policies": [_analysis(analysis) for analysis in choice.analyses],
    }


def _analysis(analysis: Analysis) -> dict[str, Any]:
    found: dict[str, Any] = {
        "name": analysis.policy,
        "schedulable": analysis.is_schedulable,
        "allFinish": analysis.all_finish,
        "worstLatenessCycles": int(analysis.worst_lateness) if analysis.all_finish else None,
        "bufferBytes": analysis.buffer,
        "luts": analysis.lut,
    }
    if analysis.priorities:
        found["priorities"] = list(analysis.priorities)
    found["publishers"] = [
        {
            "name": bound.task.name,
            "periodCycles": bound.task.period,
            "wcetCycles": bound.task.transfer_time,
            "deadlineCycles": bound.task.deadline,
            "responseCycles": bound.response,
            "latenessCycles": bound.lateness,
            "bufferBytes": bound.buffer,
        }
        for bound in analysis.bounds
    ]
    return found


def _text(choice: Choice) -> str:
    best = choice.best
    bounds = [
        (
            bound.task.name,
            *map(str, (bound.task.period, bound.task.transfer_time, bound.task.deadline)),
            *map(_number, (bound.response, bound.lateness, bound.buffer)),
        )
        for bound in best.bounds
    ]
    policies = [
        (
            analysis.policy,
            "yes" if analysis.is_schedulable else "no",
            "yes" if analysis.all_finish else "no",
            _number(int(analysis.worst_lateness) if analysis.all_finish else None),
            _number(analysis.buffer),
            _number(analysis.lut),
        )
        for analysis in choice.analyses
    ]
    columns = ("publisher", "period", "transfer time", "deadline", "response", "lateness", "buffer")
    others = ("policy", "all deadlines met", "all finish", "worst lateness", "buffers", "LUT")
    parts = [
        f"scheduler: {best.policy}\n",
        "\n".join(choice.reasons) + "\n",
        "Times are worst-case bounds in cycles; buffers are in bytes.\n",
        grid(columns, bounds),
        grid(others, policies),
        "\n".join(f"{analysis.policy}: {end_of(analysis)}" for analysis in choice.analyses) + "\n",
    ]
    return "\n".join(parts)


def _number(value: int | None) -> str:
    return UNKNOWN if value is None else str(value)
