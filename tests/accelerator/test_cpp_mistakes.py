"""Functions in C++ for HLS that differ from the interface, each reported with the user's file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.accelerator.check import check_accelerators
from fusesoc_firm.accelerator.unit import Libraries
from fusesoc_firm.cli import main
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.diagnostics import Diagnostic, InputError
from tests.applications.applications import SPECS
from tests.applications.test_kernels import IN_CPP, in_cpp, with_streams

TYPED = Path(__file__).parents[1] / "system" / "simulated" / "data" / "typed.yaml"
VALUES = "geometry_msgs/PoseWithCovariance", "geometry_msgs/Accel"
STREAMS = "sensor_msgs/Range", "std_msgs/String"
# Old text, new text, the reported line and column, and a part of the report.
OF_VALUES = [
    ("pose_position_x_in", "pose_x_in", "8:17", "parameter 'pose_x_in' is not in the interface"),
    ("pose_position_x_in,", "x,", "8:17", "needed here: double pose_position_x_in"),
    ("port=pose_position_x_in", "port=pose_x_in", "9:41", "port 'pose_x_in' is not in the interface"),
    ("double pose_position_x_in, ", "", "8:6", "function 'acc' has no parameter 'pose_position_x_in'"),
    ("(double pose_position_x_in", "(int level, double pose_position_x_in", "8:14", "= remove it"),
    ("x_in, double pose_position_y_in", "y_in, double pose_position_x_in", "", "parameter 1 is 'pose_position_y_in'"),
    ("(double ", "(float ", "", "is 'float pose_position_x_in', and the interface needs 'double pose_position_x_in'"),
    ("covariance_in[36]", "covariance_in[6]", "", "the interface needs 'double covariance_in[36]'"),
    ("double covariance_in[36]", "double *covariance_in", "", "the interface needs 'double covariance_in[36]'"),
    ("double *linear_x_out", "double linear_x_out", "", "the interface needs 'double *linear_x_out'"),
    ("mode=ap_vld port=linear_x", "mode=ap_none port=linear_x", "", "has the mode ap_none, and needs ap_vld"),
    ("mode=ap_vld port=linear_x", "ap_hs port=linear_x", "", "has the mode ap_hs, and needs ap_vld"),
    ("ap_ctrl_hs port=return", "s_axilite port=return", "", "has the mode s_axilite, and needs ap_ctrl_hs"),
]
OF_STREAMS = [
    ("> &range_field_in", "> &range_in", "", "needed here: hls::stream<float> &range_field_in"),
    ("port=range_field_in", "port=rang", "", "legal here: range_field_in"),
    ("<float> &range_field_in", "<double> &range_field_in", "", "needs 'hls::stream<float> &range_field_in'"),
    ("hls::stream<float> &range_field_in", "float range_field_in", "", "needs 'hls::stream<float> &range_field_in'"),
    ("mode=ap_fifo port=range_field_in", "mode=ap_none port=range_field_in", "", "and needs ap_fifo"),
    ("= header_frame_id_in.read();", "= 0;  // header_frame_id_in", "", "stream 'header_frame_id_in' is never read"),
    ("= header_frame_id_in.read();", "= 0;", "", "= 'radiation_type_in' arrives only when all elements before it"),
    ("data_length_out.write(0);", "", "", "stream 'data_length_out' is never written"),
]
# Other spellings of the same function, and functions whose declaration is unknown.
LEGAL = [
    ("double pose_position_x_in,", "/* a, b */ const double\n pose_position_x_in, // (x"),
    ("double *linear_x_out", "double &linear_x_out"),
    ("void acc(", "// void acc(int x) {\nvoid acc(int x);\nvoid acc("),
    ("mode=ap_none port=pose_position_x_in", "ap_none \\\n port = pose_position_x_in"),
    ("double pose_position_x_in,", "real pose_position_x_in,"),
    ("void acc(double pose_position_x_in", "#define REAL(name) double name\nvoid acc(REAL(pose_x_in)"),
    ("void acc(double pose_position_x_in", "#define X_IN double pose_x_in\nvoid acc(X_IN"),
    ("void acc(double pose_position_x_in", "void acc(\n#include <x.h>\n"),
    ("void acc(", '#include "acc.h"\nvoid other('),
    ("void acc(", "#define NAME(a) a##cc\nvoid NAME(a)("),
    ("void acc(double pose_position_x_in", "void acc(const pose_position_x_in"),
    ("void acc(double pose_position_x_in", "void acc(, double pose_position_x_in"),
]

READ = "const char element = header_frame_id_in.read();"
LEGAL_STREAMS = [
    (READ, "const char element = taken(header_frame_id_in);"),
    (READ, "READ(element, header_frame_id_in)"),
    (f"        {READ}", "#define NEXT header_frame_id_in.read()\n    const char element = NEXT;"),
    (f"        {READ}", '#include "further.inc"'),
    # What is unread when the function returns is dropped.
    ("= max_range_in.read();", "= 0;"),
]


def started(messages: tuple[str, str], *options: str) -> Path:
    """The source of a new project."""
    taken, given = messages
    assert main(["init", "acc", "--in", taken, "--out", given, "--language", "hls", *options]) == 0
    return Path("acc/hls/acc.cpp")


def found(specification: Path, *paths: Path) -> list[Diagnostic]:
    try:
        return list(check_accelerators(load_beside(specification, paths), Libraries))
    except InputError as error:
        return list(error.diagnostics)


def edited(messages: tuple[str, str], old: str, new: str) -> list[Diagnostic]:
    source = started(messages)
    text = source.read_text(encoding="utf-8")
    assert old in text
    source.write_text(text.replace(old, new, 1), encoding="utf-8")
    return found(Path("acc/acc.yaml"))


@pytest.mark.parametrize(
    ("messages", "old", "new", "place", "part"),
    [(messages, *case) for messages, cases in ((VALUES, OF_VALUES), (STREAMS, OF_STREAMS)) for case in cases],
)
def test_a_mistake_in_a_function(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    messages: tuple[str, str],
    old: str,
    new: str,
    place: str,
    part: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (fault,) = edited(messages, old, new)
    assert str(fault).startswith(f"acc/hls/acc.cpp:{place}"), str(fault)
    assert part in str(fault)


@pytest.mark.parametrize(
    ("messages", "old", "new"),
    [(messages, *case) for messages, cases in ((VALUES, LEGAL), (STREAMS, LEGAL_STREAMS)) for case in cases],
)
def test_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, messages: tuple[str, str], old: str, new: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert edited(messages, old, new) == []


def test_a_function_of_another_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (fault,) = edited(VALUES, "void acc(", "void accc(")
    assert str(fault).startswith("acc/acc.yaml:7:14: error: 'hls/acc.cpp' has no function 'acc'\n")
    assert fault.hint.startswith("expected: void acc(double pose_position_x_in, double pose_position_y_in,")


@pytest.mark.parametrize("language", ["hls", "vhdl"])
def test_a_source_that_is_not_yet_written_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, language: str
) -> None:
    monkeypatch.chdir(tmp_path)
    started(VALUES, "--language", language)
    for source in (*Path("acc").glob("hls/*"), *Path("acc").glob("rtl/*")):
        source.unlink()
    loaded = load_beside(Path("acc/acc.yaml"), needs_sources=False)
    assert check_accelerators(loaded, Libraries) == ()


def test_kernels_of_this_package_have_their_interfaces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    images = [with_streams(tmp_path, name, 8) / f"{name}.yaml" for name in IN_CPP]
    arm = in_cpp("robotic_arm", "RoboticArm.cpp", tmp_path)
    started(("geometry_msgs/PointStamped",) * 2, "--include", "point")
    for path in (SPECS / "quat2euler" / "quat2euler_hls.yaml", TYPED, *images, arm, Path("acc/acc.yaml")):
        assert found(path, SPECS / "robotic_arm" / "msg", TYPED.parent / "typed_msgs") == [], path
