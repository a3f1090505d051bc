"""The kernels of `make bench BENCH=kernels` for Holoso, which its own Python runs.

    HOLOSO_PYTHON tools/bench/kernels/holoso_kernels.py FOLDER

writes a folder of Verilog for each kernel and choice of stages, and prints a line of JSON for each: the kernel, the
stages, the folder, the top level, and the cycles from an input to the next one. All optional stages of the operators
are present, or none. Holoso reads the annotations, so they are not postponed.
"""

import json
import math
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import holoso

FLOAT64 = holoso.FloatFormat(11, 53)
STAGES = {"no stages": 0, "all stages": 1}
OPERATORS = {
    "fadd": holoso.FAddOperator,
    "fmul": holoso.FMulOperator,
    "fdiv": holoso.FDivOperator,
    "fmul_ilog2": holoso.FMulILog2OperatorFamily,
    "fcmp": holoso.FCmpOperator,
    "fsort": holoso.FSortOperator,
    "fexp2": holoso.FExp2Operator,
    "flog2": holoso.FLog2Operator,
    "fatan2": holoso.FAtan2Operator,
}


class Pid:
    def __init__(self) -> None:
        self._integral = 0.0
        self._before = 0.0

    def update(self, x: float, y: float) -> float:
        error = x - y
        self._integral = min(max(self._integral + 0.01 * error, -10.0), 10.0)
        slope = error - self._before
        self._before = error
        return 1.5 * error + self._integral + 0.2 * slope


class ComplementaryFilter:
    def __init__(self) -> None:
        self._roll = 0.0
        self._pitch = 0.0

    def update(self, wx: float, wy: float, ax: float, ay: float, az: float) -> tuple[float, float]:
        roll = math.atan2(ay, az)
        pitch = math.atan2(-ax, math.sqrt(ay * ay + az * az))
        turned_roll = self._roll + 0.01 * wx
        turned_pitch = self._pitch + 0.01 * wy
        self._roll = turned_roll + 0.0196078431372549 * (roll - turned_roll)
        self._pitch = turned_pitch + 0.0196078431372549 * (pitch - turned_pitch)
        return self._roll, self._pitch


def inverse_kinematics(x: float, y: float, z: float) -> tuple[float, float, float]:
    across = math.sqrt(x * x + y * y)
    up = z - 0.12
    bend = (across * across + up * up - 0.1025) / 0.1
    side = math.sqrt(1.0 - bend * bend)
    shoulder = math.atan2(up, across) - math.atan2(0.2 * side, 0.25 + 0.2 * bend)
    return math.atan2(y, x), shoulder, math.atan2(side, bend)


def quat2euler(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    sine = max(min(2.0 * (w * y - z * x), 1.0), -1.0)
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, math.asin(sine), yaw


class StateKalman:
    def __init__(self) -> None:
        self._height = 0.0
        self._rate = 0.0
        self._p00 = 1.0
        self._p01 = 0.0
        self._p10 = 0.0
        self._p11 = 1.0

    def update(self, distance: float) -> tuple[float, float, float]:
        height, rate = self._height + 0.02 * self._rate, self._rate
        a00, a01 = self._p00 + 0.02 * self._p10, self._p01 + 0.02 * self._p11
        p00, p01 = a00 + 0.02 * a01 + 4e-8, a01 + 4e-6
        p10, p11 = self._p10 + 0.02 * self._p11 + 4e-6, self._p11 + 4e-4
        g0, g1 = p00 / (p00 + 0.0025), p10 / (p00 + 0.0025)
        error = distance - height
        height, rate = height + g0 * error, rate + g1 * error
        p10, p11 = p10 - g1 * p00, p11 - g1 * p01
        p00, p01 = (1.0 - g0) * p00, (1.0 - g0) * p01
        self._height, self._rate = height, rate
        self._p00, self._p01, self._p10, self._p11 = p00, p01, p10, p11
        return height, rate, p00


KERNELS: dict[str, Callable[..., Any]] = {
    "pid": Pid().update,
    "complementary_filter": ComplementaryFilter().update,
    "inverse_kinematics": inverse_kinematics,
    "quat2euler_python": quat2euler,
    "state_kalman": StateKalman().update,
}


def operators(stage: int) -> holoso.OpConfig:
    """Return all operators, with or without their optional stages."""
    made: dict[str, Any] = {}
    for name, kind in OPERATORS.items():
        stages = {item.name: stage for item in fields(kind) if item.name.startswith("stage_")}
        made[name] = kind(FLOAT64, **stages)
    return holoso.OpConfig(**made)


def main() -> None:
    """Write all kernels to the folder that the argument names."""
    for name, target in KERNELS.items():
        for label, stage in STAGES.items():
            folder = Path(sys.argv[1]) / f"{name}_{stage}"
            result = holoso.synthesize(target, operators(stage), name=f"{name}_kernel")
            result.write(folder)
            cycles, _ = result.initiation_interval
            print(json.dumps({"kernel": name, "stages": label, "version": holoso.__version__, "folder": str(folder),
                              "top": result.module_name, "cycles": cycles}), flush=True)  # fmt: skip


main()
