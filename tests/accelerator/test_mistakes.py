"""Mistakes in an accelerator's source, each reported with the user's file and line."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from fusesoc_firm.accelerator.check import check_accelerators
from fusesoc_firm.accelerator.unit import Libraries
from fusesoc_firm.cli import main
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.diagnostics import Diagnostic, InputError
from tests.hdl.ghdl import core_files

_GENERIC = "generic (WIDTH : positive; LEVEL : natural);\n  port ("
_LATCH = "  p : process (clk)\n  begin\n    if clk = '1' then\n      {}\n    end if;\n  end process;\n"
# A text of the source, its replacement, a text in the line that is reported, and a part of the message.
VHDL = [
    # names
    ("entity img is", "entity image is", "entity image is", "the entity is 'image'"),
    ("    in_height ", "    in_heigth ", "in_heigth", "port 'in_heigth' is not in the interface"),
    ("    out_data ", "    result ", "entity img", "no port 'out_data' for std_msgs/UInt32.data"),
    ("    clk   :", "    clock :", "clock", "port 'clock' is not in the interface"),
    ("    rst_n : in  std_logic;\n", "", "entity img", "no port 'rst_n'"),
    # missing and superfluous ports
    (
        "    in_width                       : in  std_logic_vector(31 downto 0);",
        "",
        "entity img is",
        "entity 'img' has no port 'in_width' for sensor_msgs/Image.width",
    ),
    ("    in_msg_ready                   : out std_logic;\n", "", "entity img", "no port 'in_msg_ready'"),
    ("    rst_n : in", "    enable : in std_logic;\n    rst_n : in", "enable", "port 'enable' is not in the interface"),
    (
        "    rst_n : in",
        "    irq : out std_logic;\n    rst_n : in",
        "irq",
        "port 'irq' is not in the interface, and stays open",
    ),
    # widths
    (
        "in_height                      : in  std_logic_vector(31 downto 0)",
        "in_height : in std_logic_vector(15 downto 0)",
        "in_height",
        "in_height has 16 bits, sensor_msgs/Image.height has 32",
    ),
    (
        "in_step                        : in  std_logic_vector(31 downto 0)",
        "in_step : in std_logic_vector(32 downto 1 + 0 * 7)",
        "",
        "",
    ),
    (
        "in_segment_valid               : in  std_logic_vector(2 downto 0)",
        "in_segment_valid : in std_logic_vector(1 downto 0)",
        "in_segment_valid",
        "in_segment_valid has 2 bits, sensor_msgs/Image has 3",
    ),
    (
        "in_data_axis_tdata             : in  std_logic_vector(7 downto 0)",
        "in_data_axis_tdata : in std_logic_vector(0 to 2 ** 5 - 1)",
        "in_data_axis_tdata",
        "in_data_axis_tdata has 32 bits, sensor_msgs/Image.data has 8",
    ),
    # directions
    ("out_data                       : out", "out_data : in ", "out_data", "out_data is an input"),
    ("in_width                       : in ", "in_width : out", "in_width", "in_width is an output"),
    ("in_msg_ready                   : out", "in_msg_ready : buffer", "in_msg_ready", "in_msg_ready is a buffer port"),
    # types
    (
        "out_segment_valid              : out std_logic_vector(0 downto 0)",
        "out_segment_valid : out std_logic",
        "out_segment_valid",
        "has the type std_logic, std_msgs/UInt32 needs std_logic_vector(0 downto 0)",
    ),
    (
        "in_width                       : in  std_logic_vector(31 downto 0)",
        "in_width : in integer",
        "in_width",
        "in_width has the type integer",
    ),
    (
        "in_width                       : in  std_logic_vector(31 downto 0)",
        "in_width : in bit_vector(31 downto 0)",
        "in_width",
        "in_width has the type bit_vector",
    ),
    ("in_msg_valid                   : in  std_logic;", "in_msg_valid : in boolean;", "in_msg_valid", "type boolean"),
    ("std_logic;  -- all input", "std_logik;  -- all input", "std_logik", 'no declaration for "std_logik"'),
    # generics
    ("  port (", f"  {_GENERIC}", "LEVEL", "generic 'level' has no value"),
    # syntax, names and types in the architecture
    ("  is_there <= in_msg_valid;", "  is_there <= in_msg_valid", "is_there", "';' expected at end of signal"),
    ("end entity;", "end entiti;", "end entiti", 'misspelling, "img" expected'),
    (
        "begin\n\n",
        "begin\n  p : process (clk)\n  begin\n    if clk = '1' then\n  end process;\n",
        "end process",
        "'if' is expected instead of 'process'",
    ),
    ("  is_there <= in_msg_valid;", "  is_there <= in_msg_vald;", "in_msg_vald", 'no declaration for "in_msg_vald"'),
    (
        "  in_msg_ready <= is_there and",
        "  in_msg_ready <= in_segment_valid and",
        "in_segment_valid and",
        'operator "and"',
    ),
    ("  in_msg_ready <= is_there", "  in_msg_valid <= is_there", "in_msg_valid <= is_there", "can't be assigned"),
    ("begin\n\n", "begin\n  u : entity work.adder;\n", "work.adder", 'unit "adder" not found'),
    ("use ieee.std_logic_1164.all;", "use ieee.std_logic_1146.all;", "1146", 'unit "std_logic_1146" not found'),
    (
        "begin\n\n",
        "begin\n  p : process\n  begin\n    is_there <= in_msg_valid;\n  end process;\n",
        "process",
        "infinite loop",
    ),
    ("architecture rtl of img", "architecture rtl of image", "of image", "entity 'image' was not analysed"),
    # latches and loops, of which GHDL 2.0 says nothing
    (
        "  is_there <= in_msg_valid;",
        _LATCH.format("is_there <= in_msg_valid;"),
        "",
        "latch inferred for 'is_there'",
    ),
    (
        "  out_data <= (others => '0');\n",
        _LATCH.format("out_data(0) <= '1';") + "  out_data(31 downto 1) <= (others => '0');\n",
        "",
        "combinational loop in 'img'",
    ),
    # a valid that waits for a ready
    (
        "(others => is_there);",
        "(others => is_there and out_msg_ready);",
        "is_there and out_msg_ready",
        "'out_segment_valid' waits for 'out_msg_ready'",
    ),
    ("(others => is_there);", "(others => out_msg_ready);", "valid <= (others", "waits for 'out_msg"),
    (
        "(others => is_there);",
        "(others => is_there and out_msg_ready) when rising_edge(clk);",
        "",
        "",
    ),
    # two sources of a signal
    ("  out_data <= (others => '0');\n", "", "out_data   ", "output 'out_data' has no source"),
    ("begin\n\n", "begin\n  out_data <= in_step;\n", "out_data <= (others", "'out_data' has more than one source"),
    ("begin\n\n", "begin\n  is_there <= clk when rst_n = '0' else 'Z';\n", "", ""),
]
_INSTANCE = "copy u (.i(in_step), .o(out_data));"
_ZERO = "assign out_data = 32'b0;"
VERILOG = [
    ("module img ", "module image ", "module image", "the module is 'image'"),
    ("[31:0] in_height", "[31:0] in_heigth", "in_heigth", "port 'in_heigth' is not in the interface"),
    (
        "[31:0] in_height",
        "[15:0] in_height",
        "in_height",
        "in_height has 16 bits, sensor_msgs/Image.height has 32",
    ),
    ("input  wire [31:0] in_width", "output wire [31:0] in_width", "in_width", "in_width is an output"),
    ("  input  wire        in_msg_valid,\n", "", "module img", "no port 'in_msg_valid' for sensor_msgs/Image"),
    ("  input  wire rst_n,", "  input  wire rst_n,\n  input wire enable,", "enable", "port 'enable' is not in"),
    ("  input  wire rst_n,", "  input  wire rst_n", "in_payload_length", "syntax error"),
    ("is_there && out_msg_ready;", "is_there && out_msg_ready", "assign out_segment_valid", "syntax error"),
    ("in_msg_ready = is_there", "in_msg_ready = is_their", "is_their", "'is_their' is not declared"),
    ("endmodule", "", "", "syntax error"),
    # a valid that waits for a ready
    ("{1{is_there}};", "is_there && out_msg_ready;", "is_there &&", "'out_segment_valid' waits for 'out_msg_ready'"),
    ("{1{is_there}};", "out_msg_ready;", "valid = out", "waits for 'out_msg_ready'"),
    # latches
    (_ZERO, "reg [31:0] r; always @* if (clk) r = in_step; assign out_data = r;", "always", "latch inferred for 'r'"),
    (
        _ZERO,
        "unknown u (.i(in_step), .o(out_data)); reg r; always @(posedge clk) r <= rst_n;",
        "unknown",
        "there is no module 'unknown' in the sources and",
    ),
    # sources of signals
    (f"  {_ZERO}", "", "out_data", "output 'out_data' has no source"),
    ("out_data = 32'b0;", "out_data[7:0] = 8'b0;", "out_data", "a part of output 'out_data' has no source"),
    (_ZERO, f"{_ZERO}\n  assign out_data[7] = 1'b1;", "data[7] =", "'out_data' has more than one source"),
    (_ZERO, f"{_INSTANCE}\n  copy v (.i(in_width), .o(out_data[31:0]));", "copy v", "has more than one source"),
    (_ZERO, f"{_ZERO} assign in_step = 32'b1;", "in_step", "'in_step' is an input, and is assigned"),
    (_ZERO, "always @* out_data = 32'b0;", "always", "'out_data' is a wire, and is assigned in a block"),
    (_ZERO, "reg [31:0] r; assign r = 0; assign out_data = r;", "reg", "'r' is a reg, and is assigned in a continuous"),
    ("out_data = 32'b0;", "out_data = in_step[32:1];", "in_step[32", "'in_step' does not have the bits [32:1]"),
]
_COPY = "module copy (input [31:0] i, output [31:0] o); assign o = i; endmodule\n"
LEGAL_VERILOG = [
    f"reg r; always @(posedge clk) r <= out_msg_ready; {_ZERO}",
    "assign out_data = in_msg_valid ? 32'bz : 0; assign out_data[0] = 1'bz;",
    _INSTANCE,
    "copy u (.i(in_step), .o({out_data[3:0], out_data[31:4]}));",
    "copy u (in_step, out_data);",
    "integer i; reg [31:0] a, b; assign out_data = a ^ b;"
    + "".join(f" always @(posedge clk) for (i = 0; i < 32; i = i + 1) {name}[i] <= in_step[31 - i];" for name in "ab"),
    "reg [31:0] m[0:3]; always @(posedge clk) m[in_step[1:0]] <= in_step; assign out_data = m[in_width[1:0]];",
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def diagnostics(
    language: str, old: str, new: str, libraries: Libraries | None = None, copy: str = _COPY
) -> list[Diagnostic]:
    """The faults and warnings about a new project whose accelerator is changed at one place."""
    arguments = ("--language", language, "--in", "sensor_msgs/Image", "--out", "std_msgs/UInt32")
    assert main(["init", "img", *arguments]) == 0
    (source,) = Path("img/rtl").iterdir()
    # The analysis has no files of this library.
    text = re.sub("library firm;.*\n", "", source.read_text(encoding="utf-8"))
    assert old in text
    source.write_text(text.replace(old, new, 1) + copy * (language == "verilog"), encoding="utf-8")
    loaded = load_beside(Path("img/img.yaml"))
    try:
        return list(check_accelerators(loaded, lambda: libraries or Libraries(is_complete=True)))
    except InputError as error:
        return list(error.diagnostics)


def check(found: list[Diagnostic], file: str, where: str, message: str) -> None:
    told = [item for item in found if _without_quotes(message) in _without_quotes(item.message)]
    assert told, [str(item) for item in found]
    assert told[0].source
    assert told[0].source.file == file
    assert where in told[0].source.text, str(told[0])


def _without_quotes(message: str) -> str:
    """Which ones GHDL uses depends on its version."""
    return re.sub("[\"']", "", message)


@pytest.mark.parametrize(("old", "new", "where", "message"), VHDL)
def test_a_mistake_in_vhdl(old: str, new: str, where: str, message: str) -> None:
    found = diagnostics("vhdl", old, new)
    if message:
        check(found, "img/rtl/img.vhd", where, message)
    else:
        assert not found, [str(item) for item in found]


_OUT, _READY = "out_data <= (others => '0');", "in_msg_ready <= is_there and out_msg_ready;"
_PROCESS = "process (clk)\n  begin\n    if rising_edge(clk) then\n      out_data <= in_step;\n"


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("library ieee;\nuse ieee.std_logic_1164.all;\n", "", "'use ieee.std_logic_1164.all;' above the entity"),
        (
            "use ieee.std_logic_1164.all;\n",
            "use ieee.std_logic_1164.all;\nuse ieee.std_logic_unsigned.all;\n",
            "numeric_std",
        ),
        (_OUT, "out_data <= std_logic_vector(unsigned(in_step) + to_unsigned(1, 32));", "'use ieee.numeric_std.all;'"),
        (_OUT, "out_data <= in_step + 1;", "a std_logic_vector is not a number: a float needs an operation"),
        (_OUT, "out_data <= in_step and '1';", "both sides need the same type"),
        (_OUT, "out_data <= in_stp;", "did you mean 'in_step'?"),
        (_OUT, "out_data <= in_step when in_msg_valid;", "a condition is a comparison, such as valid = '1'"),
        (_OUT, "out_data <= '0';", "a vector is a string of bits"),
        (_OUT, "out_data <= 5;", "to_unsigned(5, 8)"),
        (_OUT, "out_data := in_step;", "with '<='"),
        (_OUT, "process (clk) begin out_data = in_step; end process;", "a variable with ':='"),
        (_OUT, "process (all) begin out_data <= in_step; end process;", "write 'standard: 2008' for this accelerator"),
        (_OUT, f"{_PROCESS}    end if;\n", "an 'end process;' is missing above"),
        (_OUT, f"{_PROCESS}  end process;\n", "an 'end if;' is missing above"),
        (_READY, "in_msg_ready <= out_segment_valid(0);", "assign a signal, and the port from it"),
        ("    clk   : in  std_logic;", "    clk   : in  std_logic", "is a ';' missing at the end of the line above?"),
        ("out_msg_ready                  : in  std_logic\n", "out_msg_ready : in std_logic;\n", "has no ';'"),
        ("end architecture;", "", "an 'end' is missing"),
        (_OUT, "out_data <= '00000000';", "a vector has double quotes"),
        (_OUT, "process (clk) signal s : bit; begin out_data <= in_step; end process;", "declare a variable here"),
        (_OUT, f"{_OUT} u : entity work.gain port map (clk => clk);", "add the file with 'gain' to 'sources'"),
        ("architecture rtl of img", "architecture rtl of image", "the entity in this file is 'img'"),
        (_OUT, "out_data <= in_step(15 downto 0);", "compare the ranges"),
        (
            _OUT,
            f"if in_msg_valid = '1' then\n    {_OUT}\n  else\n    {_OUT}\n  end if;",
            "'if', 'case' and 'loop' are statements in a process",
        ),
        (
            _OUT,
            'process (in_step) begin case in_step(1 downto 0) is when "00" => null; end case; end process;',
            "add the choice 'when others => ...'",
        ),
        ("  signal is_there", "  signal is_there : std_logic;\n  signal is_there", "rename one of them, or remove it"),
        (_READY, "", "assign it a value: no message passes without it"),
        (_OUT, "u : entity work.img port map (clk => clk, '1');", "connect all by name: 'port => signal'"),
        ("begin\n\n", "begin\n  out_data <= in_step;\n", "and remove the others; see also line "),
    ],
)
def test_a_mistake_in_vhdl_is_one_fault_with_a_cure(old: str, new: str, hint: str) -> None:
    """GHDL names no cure, and lists what follows: every use of a missing package, the end of each open statement."""
    (fault,) = diagnostics("vhdl", old, new)
    assert not fault.is_warning
    assert hint in fault.hint


def test_a_latch_and_a_loop_have_their_own_cures() -> None:
    """A register breaks a loop, whose signal may be assigned in each branch."""
    there = "  is_there <= in_msg_valid;"
    (found,) = diagnostics("vhdl", there, "  is_there <= in_msg_valid xor is_there;")
    assert "combinational loop in 'img': 'is_there'" in found.message
    assert found.hint == "break the loop by a register: assign one of its signals at a clock edge"
    shutil.rmtree("img")
    (found,) = diagnostics("vhdl", there, _LATCH.format("is_there <= in_msg_valid;"))
    assert found.hint == "assign it in every branch of its process, or only at a clock edge"


def test_faults_in_several_lines_are_all_reported() -> None:
    found = diagnostics("vhdl", _OUT, "out_data <= in_stp;\n  is_ther <= in_msg_vald;")
    assert [item.hint for item in found] == [
        f"did you mean '{name}'?" for name in ("in_step", "is_there", "in_msg_valid")
    ]


@pytest.mark.parametrize(("old", "new", "where", "message"), VERILOG)
def test_a_mistake_in_verilog(old: str, new: str, where: str, message: str) -> None:
    check(diagnostics("verilog", old, new), "img/rtl/img.v", where, message)


_BLOCK = "reg [31:0] r; always @(posedge clk) "


@pytest.mark.parametrize(
    ("old", "new", "where", "hint"),
    [
        ("endmodule", "", "in_data_axis_tready", "an 'endmodule' or a 'begin' without 'end' is missing above"),
        (_ZERO, "assign out_data = 32'b0", "assign in_header_frame", "is a ';' or an 'end' missing above?"),
        (
            _ZERO,
            f"{_BLOCK} begin r <= in_step;\n  assign out_data = r;",
            "assign out_data",
            "is a ';' or an 'end' missing",
        ),
        (_ZERO, f"logic [31:0] r; {_ZERO}", "logic", "'logic' is SystemVerilog, whose files end in .sv: rename img.v"),
        (_ZERO, "always_comb out_data = 32'b0;", "always_comb", "'always_comb' is SystemVerilog"),
        (
            "input  wire rst_n,",
            "input  wire rst_n",
            "in_payload_length",
            "is a ',' missing at the end of the line above?",
        ),
        (_ZERO, "assign out_data <= 32'b0;", "assign", "write '=': an 'assign' has no '<='"),
        (_ZERO, "out_data = 32'b0;", "out_data", "write 'assign' before it, or put it into an 'always' block"),
        (_ZERO, f"{_BLOCK} if (in_step = 1) r <= 1;", "always", ""),
    ],
)
def test_a_fault_in_the_syntax_of_verilog_has_a_cure(old: str, new: str, where: str, hint: str) -> None:
    """Yosys reports a missing 'endmodule' in the first line of the file."""
    (fault,) = diagnostics("verilog", old, new, copy="")
    assert "syntax error, unexpected" in fault.message
    assert hint in fault.hint
    assert bool(hint) == bool(fault.hint)
    assert fault.source
    assert where in fault.source.text


@pytest.mark.parametrize(
    ("new", "hint", "is_warning"),
    [
        ("assign out_data = in_stepp;", "did you mean 'in_step'?", False),
        ("assign out_data = qwqwqw;", "declare it: an undeclared name is a wire of 1 bit", False),
        (f"copy u (.i(in_step), .o(between)); copy v (.i(between), .o()); {_ZERO}", "declare it", True),
    ],
)
def test_an_undeclared_name_that_does_not_connect_instances_is_a_fault(new: str, hint: str, is_warning: bool) -> None:
    (found,) = diagnostics("verilog", _ZERO, new)
    assert (found.is_warning, found.hint[: len(hint)]) == (is_warning, hint)


@pytest.mark.parametrize("new", LEGAL_VERILOG)
def test_signals_in_verilog_with_right_sources(new: str) -> None:
    assert diagnostics("verilog", _ZERO, new) == []


def test_an_unknown_port_of_an_own_module() -> None:
    (fault,) = [item for item in diagnostics("verilog", _ZERO, "copy u (.ii(in_step), .o(out_data));") if item.hint]
    assert (fault.message, fault.hint) == ("'copy' has no port 'ii'", "did you mean 'i'?")


def test_what_a_missing_unit_declares_is_unknown() -> None:
    """Without the files of other cores, faults that may follow from a missing package are not reported."""
    old, new = "architecture rtl of img is", "use work.numbers.all;\narchitecture rtl of img is signal s : number;"
    assert diagnostics("vhdl", old, new, Libraries()) == []


def test_the_width_of_a_generic_is_known() -> None:
    parts = ("in_data_axis_tdata             : in  std_logic_vector(7 downto 0)", "in_data_axis_tdata : in w")
    new = parts[1].replace("in w", "in std_logic_vector(4 * WIDTH - 1 downto 0)")
    assert main(["init", "img", "--in", "sensor_msgs/Image", "--out", "std_msgs/UInt32"]) == 0
    source = Path("img/rtl/img.vhd")
    text = source.read_text(encoding="utf-8").replace("  port (", "  generic (WIDTH : positive := 16);\n  port (", 1)
    source.write_text(text.replace(parts[0], new), encoding="utf-8")
    with pytest.raises(InputError, match=r"in_data_axis_tdata has 32 bits, sensor_msgs/Image\.data has 8"):
        check_accelerators(load_beside(Path("img/img.yaml")), Libraries)


def test_many_superfluous_ports_are_one_fault() -> None:
    ports = "".join(f"    extra_{number} : in std_logic;\n" for number in range(9))
    (fault,) = diagnostics("vhdl", "    rst_n : in", f"{ports}    rst_n : in")
    assert fault.message.endswith("'extra_3' and 5 more are not in the interface")
    assert "firm system skeleton" in fault.hint


_PARAMETERS = "#(.EXPONENT_BITS(8), .MANTISSA_BITS(23))"
_PORTS = (
    ".clk(clk), .rst_n(rst_n), .in_valid(1'b1), .in_ready(), .in_a(in_step), .in_b(in_width), .out_valid(), "
    ".out_ready(1'b1), .out_number(out_data)"
)


@pytest.mark.parametrize(
    ("instance", "message", "hint"),
    [
        (f"firm_float_multiply {_PARAMETERS} u ({_PORTS});", "", ""),
        (
            f"firm_float_multiply u ({_PORTS});",
            "'in_a' of 'firm_float_multiply' has 64 bits here, and is",
            "select the size by the parameters EXPONENT_BITS and MANTISSA_BITS: 8 and 23 for float32, 11 and 52 for",
        ),
        (
            f"firm_float_multiply {_PARAMETERS} u ({_PORTS.replace('in_width', 'in_width[15:0]')});",
            "'in_b' of 'firm_float_multiply' has 32 bits here, and is connected to 16",
            "connect as many bits, or change the parameters EXPONENT_BITS and MANTISSA_BITS: 8",
        ),
        (
            "firm_fixed_to_float #(.WIDTH(16)) u (.clk(clk), .rst_n(rst_n), .in_number(in_step));",
            "'in_number' of 'firm_fixed_to_float' has 16 bits here",
            "connect as many bits, or change the parameters WIDTH",
        ),
        (
            f"firm_float_multiply {_PARAMETERS.replace('BITS', 'BIT', 1)} u ({_PORTS});",
            "no parameter 'EXPONENT_BIT'",
            "did you mean 'EXPONENT_BITS'?",
        ),
        (
            f"firm_float_multiply {_PARAMETERS} u ({_PORTS.replace('in_b', 'b')});",
            "no port 'b'",
            "legal here: clk, rst_n",
        ),
        (
            f"firm_float_multiply {_PARAMETERS} u ({_PORTS.replace('.in_b(in_width), ', '')});",
            "input 'in_b' of 'firm_float_multiply' is not connected",
            "connect it",
        ),
        (
            f"firm_float_add {_PARAMETERS} u ({_PORTS});",
            "input 'in_subtract' of 'firm_float_add' is not connected",
            "connect",
        ),
        (
            f"firm_float_multiply {_PARAMETERS} u (.clk(clk), .rst_n(rst_n), .in_valid(1'b1), .out_ready(1'b1));",
            "inputs 'in_a' and 'in_b' of 'firm_float_multiply' are not connected",
            "connect them",
        ),
        (f"firm_float_multiply {_PARAMETERS} u (clk, rst_n);", "its ports are connected by name", ".port(net)"),
        (
            f"firm_float_multipli {_PARAMETERS} u ({_PORTS});",
            "no module 'firm_float_multipli'",
            "'firm_float_multiply'?",
        ),
        ("firm_axis_fifo u ();", "no module 'firm_axis_fifo' in the sources", "it is in robot:axis:firm_axis"),
        (
            f"firm_float_multiply {_PARAMETERS.replace('8', 'TEXT')} u ({_PORTS});".replace("TEXT", '"8"'),
            "parameter 'EXPONENT_BITS' of 'firm_float_multiply' is a positive, not a text",
            "write the number without quotation marks",
        ),
        (
            f'firm_fixed_to_float {_PARAMETERS[:-1]}, .IS_SIGNED("false")) u (.clk(clk));',
            "parameter 'IS_SIGNED' of 'firm_fixed_to_float' is a boolean, not a text",
            "write 1 for true, and 0 for false, without quotation marks",
        ),
    ],
)
def test_entities_of_other_cores_in_verilog(instance: str, message: str, hint: str) -> None:
    others = Libraries([(path, "firm") for path in core_files("acc/float/float")], is_complete=True)
    found = diagnostics("verilog", _ZERO, instance, others)
    if not message:
        assert found == []
        return
    told = next(item for item in found if message in item.message)
    assert told.source
    assert hint in told.hint
    assert instance.split(maxsplit=1)[0] in told.source.text


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (".MANTISSA_BITS(23)", ".MANTISA_BITS(23)", ".MANTISA_BITS"),
        (".in_b(in_width)", ".in_c(in_width)", ".in_c("),
        (".in_b(in_width)", ".in_b(in_width[7:0])", ".in_b("),
    ],
)
def test_a_fault_in_an_instance_has_the_place_of_the_name(old: str, new: str, line: str) -> None:
    """Yosys knows only the place of the instance."""
    others = Libraries([(path, "firm") for path in core_files("acc/float/float")], is_complete=True)
    instance = f"firm_float_multiply {_PARAMETERS} u ({_PORTS});".replace(", ", ",\n    ").replace(old, new)
    (fault,) = diagnostics("verilog", _ZERO, instance, others)
    assert fault.source
    assert fault.source.text[fault.source.column - 2 :].startswith(line)


def test_a_float_of_the_wrong_size_in_vhdl() -> None:
    """GHDL reports it at elaboration, seven lines of which name neither the file nor the generics."""
    instance = (
        "begin\n  u_gain : entity firm.firm_float_multiply\n    port map (\n"
        "      clk => clk, rst_n => rst_n, in_valid => '1', in_ready => open,\n"
        "      in_a => in_step, in_b => in_step, out_valid => open, out_ready => '1', out_number => out_data\n    );\n"
    )
    assert main(["init", "img", "--in", "sensor_msgs/Image", "--out", "std_msgs/UInt32"]) == 0
    source = Path("img/rtl/img.vhd")
    text = source.read_text(encoding="utf-8").replace("  out_data <= (others => '0');\n", "")
    source.write_text("library firm;\n" + text.replace("begin\n", instance, 1), encoding="utf-8")
    files = [(path, "firm") for path in core_files("acc/cordic/cordic", "acc/float/float")]
    with pytest.raises(InputError) as refused:
        check_accelerators(load_beside(Path("img/img.yaml")), lambda: Libraries(files, is_complete=True))
    fault = refused.value.diagnostics[0]
    assert "32 bits, but 64 are needed here" in fault.message
    assert fault.source
    assert "in_a => in_step" in fault.source.text
    wanted = "EXPONENT_BITS and MANTISSA_BITS: 8 and 23 for float32, 11 and 52 for float64"
    assert fault.hint == f"select the size by the generics of 'u_gain', {wanted}"


@pytest.mark.parametrize(
    ("part", "hint"),
    [
        ("multiply generic map (EXPONENT_BIT => 8) port map (clk => clk)", "did you mean 'EXPONENT_BITS'?"),
        (
            "multiply port map (clk => clk, x => in_step)",
            "legal here: clk, rst_n, in_valid, in_ready, in_a, in_b, out_",
        ),
        ("mutliply port map (clk => clk)", "did you mean 'firm_float_multiply'?"),
    ],
)
def test_an_unknown_name_of_an_instance(part: str, hint: str) -> None:
    libraries = Libraries([(path, "firm") for path in core_files("acc/float/float")], is_complete=True)
    new = f"library firm;\narchitecture rtl of img is\nbegin\n  u : entity firm.firm_float_{part};\n"
    found = diagnostics("vhdl", "architecture rtl of img is", f"{new}end;\narchitecture other of img is", libraries)
    assert any(item.hint.startswith(hint) for item in found), [str(item) for item in found]


def test_a_bit_for_a_vector() -> None:
    found = diagnostics("vhdl", "  out_segment_valid <= (others => is_there);", "  out_segment_valid <= is_there;")
    assert found[0].hint == "'is_there' is one bit: write target(0) <= is_there, or (others => is_there) for all bits"


def test_the_library_of_the_arithmetic_is_named() -> None:
    (fault, *_) = diagnostics("vhdl", "begin\n", "begin\n  u_add : entity firm.firm_float_add port map (clk => clk);\n")
    assert fault.message.endswith('no declaration for "firm"')
    assert fault.hint == "write 'library firm;' at the top of the file"


def test_without_the_program_the_check_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fusesoc_firm.accelerator.check.find", lambda _: None)
    (warning,) = diagnostics("vhdl", "img", "img")
    assert "not read, since ghdl is not installed: img" in str(warning)
