"""What GHDL 2.0 writes or synthesises wrongly, a design for each, which `make fuzz-netlist` and users have found."""

from __future__ import annotations

from tests.netlist.designs import INPUT, OUTPUT, Design


def _design(name: str, width: int, value: str, declarations: str = "", statements: str = "") -> Design:
    """A design that puts out one value of so many bits; `s` and `u` are 16 signed and unsigned bits of the input."""
    text = f"""library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity {name} is
  port (clk, rst : in std_logic; x : in std_logic_vector({INPUT - 1} downto 0);
    y : out std_logic_vector({OUTPUT - 1} downto 0));
end entity {name};

architecture rtl of {name} is
  signal s : signed(15 downto 0);
  signal u : unsigned(15 downto 0);
  signal q : std_logic_vector({width - 1} downto 0);
  {declarations}
begin
  s <= signed(x(15 downto 0));
  u <= unsigned(x(15 downto 0));
  {statements}
  q <= std_logic_vector({value});
  y <= std_logic_vector(resize(unsigned(q), {OUTPUT}));
end architecture rtl;
"""
    return Design(name, name, text)


def _clocked(body: str, declarations: str = "") -> str:
    return f"process (clk)\n  {declarations}\n  begin\n  if rising_edge(clk) then\n  {body}\n  end if;\n  end process;"


_WORDS = "type words is array (0 to 3) of std_logic_vector(7 downto 0);"
_PLACE, _OTHER = "to_integer(unsigned(x(17 downto 16)))", "to_integer(unsigned(x(19 downto 18)))"
_INTEGER = "to_integer(unsigned(x(46 downto 16)))"
_RESULT = 'signal r : std_logic_vector(7 downto 0) := X"A5";'

FAULTS = [
    _design("gain", 32, "s * K", "constant K : signed(15 downto 0) := to_signed(93, 16);"),
    _design("divided", 16, 's / (signed(x(31 downto 16)) or signed\'(X"0001"))'),
    _design("modulus", 16, 's mod (signed(x(31 downto 16)) or signed\'(X"0001"))'),
    _design("rest", 16, 's rem (signed(x(31 downto 16)) or signed\'(X"0001"))'),
    _design("shifted", 16, "shift_right(s, to_integer(unsigned(x(20 downto 16))))"),
    _design("absolute", 16, "abs s"),
    _design("long", 80, 'signed(x(79 downto 0)) + signed\'(X"F0123456789ABCDEF012")'),
    _design("long_zero", 64, 'signed(x(79 downto 16)) xor signed\'(X"0000000000000000")'),
    _design("negative", 80, "signed(x(79 downto 0)) - (-3)"),
    _design("subtracted", 16, "100 - s"),
    _design("subtracted_within", 16, '5 - shift_left("-"(100, s) - (3 - (7 - s)), 1)'),
    _design(
        # Its value is all that a slice takes, so that GHDL's netlist has the slice's place for the subtraction.
        "subtracted_for_a_function",
        16,
        "whole(5 - s)",
        "function whole(p : signed(15 downto 0)) return signed is begin return p(15 downto 0); end;",
    ),
    _design("subtracted_by_full_name", 16, 'ieee.numeric_std."-"(5, s)'),
    _design("rotated", 16, "rotate_left(u, to_integer(unsigned(x(22 downto 16))))"),
    _design("rotated_right", 7, "rotate_right(u(6 downto 0), to_integer(unsigned(x(22 downto 16))))"),
    _design("narrowed", 5, "resize(s, 5)"),
    _design("narrowed_to_a_bit", 1, "ieee.numeric_std.resize(s, 1)"),
    _design(
        "narrowed_in_a_variable",
        5,
        "r",
        "signal r : signed(4 downto 0);",
        "process (s) variable v : signed(4 downto 0); begin v := resize(s, 5); r <= v(4 downto 0); end process;",
    ),
    _design("product_with_a_number_that_is_cut", 48, f"unsigned'(unsigned(s(7 downto 0) * 1000) & u * {_INTEGER})"),
    _design(
        "divided_by_a_number_that_does_not_fit", 24, f"signed'(s / ({_INTEGER} mod 70000 + 1) & s(7 downto 0) mod 1000)"
    ),
    _design("divided_number_that_does_not_fit", 8, f'({_INTEGER} mod 1000) / (u(7 downto 0) or X"04")'),
    _design(
        "compared",
        8,
        "c",
        "signal c : std_logic_vector(7 downto 0);",
        "\n  ".join(
            f"c({bit}) <= '1' when {condition} else '0';"
            for bit, condition in enumerate(
                [
                    "s < 100000",
                    "s >= -40000",
                    "s = 65535",
                    "u /= 65536",
                    "70000 > u",
                    "-70000 > s",
                    "signed(x(63 downto 0)) < -1",
                    "signed(x(79 downto 16)) > -70000",
                ]
            )
        ),
    ),
    _design(
        "compared_with_an_integer",
        8,
        "c",
        "signal c : std_logic_vector(7 downto 0);",
        "\n  ".join(
            f"c({bit}) <= '1' when {condition} else '0';"
            for bit, condition in enumerate(
                [
                    f"s < {_INTEGER}",
                    f"{_INTEGER} <= s",
                    f"u(4 downto 0) = {_INTEGER}",
                    f"u /= {_INTEGER}",
                    "s(5 downto 0) >= to_integer(signed(x(40 downto 10)))",
                    "s > to_integer(signed(x(41 downto 10)))",
                    f"unsigned(x(79 downto 16)) > {_INTEGER}",
                    f"signed(x(79 downto 16)) > {_INTEGER}",
                ]
            )
        ),
    ),
    _design(
        "selected",
        16,
        "c",
        "signal c : signed(15 downto 0);",
        'with x(17 downto 16) select c <= s when "00",\n'
        '  signed(x(33 downto 18)) when "10", to_signed(-2, 16) when others;',
    ),
    _design(
        "first_value",
        8,
        "r",
        _RESULT,
        "process (clk, rst) begin if rst = '1' and x(0) = '1' then r <= X\"3C\"; elsif rising_edge(clk) then "
        "if x(1) = '1' then r <= x(9 downto 2); end if; end if; end process;",
    ),
    _design(
        "first_value_of_a_part",
        8,
        "r",
        _RESULT,
        _clocked("r(3 downto 0) <= x(3 downto 0);\n r(7 downto 4) <= x(9 downto 6);"),
    ),
    _design("driven", 8, "r", f"{_RESULT}", 'r <= X"5A";'),
    _design(
        "memory",
        8,
        "r",
        f'{_WORDS} {_RESULT} signal m : words := (X"01", X"12", X"23", X"34");',
        _clocked(f"r <= m({_OTHER});\n if x(0) = '1' then m({_PLACE}) <= x(27 downto 20); end if;"),
    ),
    _design(
        "memory_written_first",
        8,
        "r",
        f"{_WORDS} {_RESULT}",
        _clocked(
            f"if x(0) = '1' then m({_PLACE}) := x(27 downto 20); end if;\n r <= m({_OTHER});",
            'variable m : words := (X"01", X"12", X"23", X"34");',
        ),
    ),
    _design(
        "written_parts",
        32,
        "r",
        "signal r : std_logic_vector(31 downto 0);",
        f"process (x) variable v : std_logic_vector(31 downto 0); begin v := x(63 downto 32);\n"
        f"  v({_PLACE} * 8 + 7 downto {_PLACE} * 8) := x(7 downto 0); r <= v; end process;",
    ),
    _design(
        "keywords",
        8,
        "reg xor n1_o",
        "signal reg, n1_o : std_logic_vector(7 downto 0);",
        "reg <= x(7 downto 0); n1_o <= not x(15 downto 8);",
    ),
]

# One that needs the whole netlist without memories, which is why it is apart.
WITHOUT_MEMORIES = _design(
    "mixed_indices",
    16,
    f"std_logic_vector'(m({_OTHER}) & m(1))",
    f'{_WORDS} signal m : words := (X"01", X"12", X"23", X"34");',
    _clocked(f"if x(0) = '1' then m({_PLACE}) <= x(27 downto 20); end if;"),
)

# Constants that are zero in GHDL's netlist, so that there is none.
LOST = [
    _design("digits", 64, 'signed(x(63 downto 0)) xor signed\'(X"8000000000000000")'),
    _design("named", 96, "signed(x(95 downto 0)) xor K", 'constant K : signed := X"000100000000000000000000";'),
    _design(
        "aggregate",
        64,
        "r",
        "signal r : std_logic_vector(63 downto 0) := (63 => '1', others => '0');",
        _clocked("r <= x(63 downto 0);"),
    ),
    _design(
        "reset",
        64,
        "r",
        "signal r : std_logic_vector(63 downto 0);",
        _clocked("if rst = '1' then r <= (63 downto 62 => '1', others => '0'); else r <= x(63 downto 0); end if;"),
    ),
]

_TABLE = "type words is array (0 to 7) of std_logic_vector(7 downto 0);"
_OF_TABLE = '(0 => X"01", 3 => X"80", others => X"00")'
# Those whose values GHDL computes.
COMPUTED = [
    _design("shifted_constant", 64, "unsigned(x(63 downto 0)) xor shift_left(to_unsigned(1, 64), 40)"),
    _design(
        "named_and_computed",
        64,
        "unsigned(x(63 downto 0)) xor K",
        "constant SHIFT : natural := 40; constant K : unsigned(63 downto 0) := shift_left(to_unsigned(1, 64), SHIFT);",
    ),
    _design("joined", 64, "r", "signal r : unsigned(63 downto 0);", 'r <= unsigned\'(X"00000001" & X"00000000");'),
    _design(
        "table",
        8,
        f"T({_PLACE})",
        f"{_TABLE} constant T : words := {_OF_TABLE};",
    ),
    _design(
        "reset_of_an_array",
        8,
        f"r({_PLACE})",
        f"{_TABLE} signal r : words;",
        _clocked(f"if rst = '1' then r <= {_OF_TABLE}; else r({_OTHER}) <= x(27 downto 20); end if;"),
    ),
    _design(
        "reset_of_a_record",
        64,
        "r.high & r.low",
        "type pair is record low, high : std_logic_vector(31 downto 0); end record; signal r : pair;",
        _clocked(
            'if rst = \'1\' then r <= (low => X"00000000", high => X"00000001"); else\n'
            "r <= (low => x(31 downto 0), high => x(63 downto 32)); end if;"
        ),
    ),
    _design(
        "choice",
        1,
        "r",
        "signal r : std_logic_vector(0 downto 0);",
        'process (x) begin case x(63 downto 0) is when X"0000000100000000" => r <= "1";\n'
        'when others => r <= "0"; end case; end process;',
    ),
    _design(
        "without_low_levels",
        64,
        "r",
        "signal r : std_logic_vector(63 downto 0);",
        _clocked("if rst = '1' then r <= (40 => '1', others => '-'); else r <= x(63 downto 0); end if;"),
    ),
]

_LONG_TABLE = (
    "type longs is array (0 to 3) of std_logic_vector(63 downto 0);\n"
    'constant T : longs := (0 => X"0000000000000001", 1 => X"8000000000000000", others => X"0000000000000001");\n'
    "signal r : std_logic_vector(63 downto 0);"
)
# One of a table's constants.
COMPUTED.append(
    _design(
        "element", 64, "r", _LONG_TABLE, _clocked("if rst = '1' then r <= (others => '0'); else r <= T(1); end if;")
    )
)
# Those that would be lost as a whole or alone, beside a zero of as many bits.
KEPT = [
    _design(
        "sliced",
        64,
        "r",
        'constant K : unsigned(63 downto 0) := X"8000000000000000"; signal r : unsigned(63 downto 0);',
        _clocked(
            "if rst = '1' then r <= (others => '0'); else\n"
            "r <= unsigned'(unsigned(x(63 downto 32)) xor K(63 downto 32)) & K(31 downto 0); end if;"
        ),
    ),
    _design(
        "indexed",
        64,
        "r",
        _LONG_TABLE,
        _clocked(f"if rst = '1' then r <= (others => '0'); else r <= T({_PLACE}); end if;"),
    ),
    _design(
        "read_by_a_function",
        64,
        "r",
        f"{_LONG_TABLE}\n"
        "function high (index : natural; width : positive) return std_logic_vector is\n"
        "  constant exact : std_logic_vector(63 downto 0) := T(index);\n"
        "begin\n"
        "  return exact(63 downto 64 - width);\n"
        "end function high;",
        _clocked("if rst = '1' then r <= (others => '0'); else r <= high(1, 32) & x(31 downto 0); end if;"),
    ),
]


def _instances(
    name: str, last: int, statements: str, declarations: str = "", default: str = "(others => '1')"
) -> Design:
    """A design with a chain of instances that read the input `r(0)` and compute `r(1)` to `r(last)`.

    Each instance computes `a xor (b and c and G)`.
    """
    part = f"""library ieee;
use ieee.std_logic_1164.all;

entity {name}_part is
  generic (G : std_logic_vector(63 downto 0) := (others => '1'));
  port (a : in std_logic_vector(63 downto 0); b : in std_logic_vector(63 downto 0) := {default};
    c : in std_logic_vector(0 to 63) := (others => '1'); y : out std_logic_vector(63 downto 0));
end entity {name}_part;

architecture rtl of {name}_part is
begin
  y <= a xor (b and c and G);
end architecture rtl;
"""
    rows = f"type rows is array (0 to {last}) of std_logic_vector(63 downto 0);\nsignal r : rows;\n"
    whole = _design(name, 64, f"r({last})", rows + declarations, f"r(0) <= x(63 downto 0);\n{statements}")
    return Design(name, name, part + whole.text)


_JOINED = 'X"3fe00000" & X"00000000"'
_ACTUALS = [
    'X"3fe0000000000000"',
    _JOINED,
    'X"8000000000000000" or K',
    "shifted(40)",
    "std_logic_vector(to_signed(-5, 32)) & std_logic_vector(to_signed(0, 32))",
    "(62 downto 53 | 33 => '1', others => '0')",
    "K",
]
_CONSTANTS = f"""constant K : std_logic_vector(63 downto 0) := {_JOINED};
function shifted (places : natural) return std_logic_vector is
begin
  return std_logic_vector(shift_left(to_unsigned(1, 64), places));
end function shifted;
"""
# Lost constants that the netlist has nevertheless, as it shows where they belong.
RESTORED = [
    _instances(
        "actuals",
        9,
        "\n".join(
            f"\tu{row} : entity work.actuals_part port map (a => r({row - 1}), b => {actual}, y => r({row}));"
            for row, actual in enumerate(_ACTUALS, 1)
        )
        + "g : for i in 8 to 9 generate part : entity work.actuals_part\n"
        "port map (a => r(i - 1), b => shifted(5 * i - 10), y => r(i)); end generate;",
        _CONSTANTS,
    ),
]
COMPUTED += [
    _design("an_operand", 64, f"x(63 downto 0) xor ({_JOINED})"),
    _design(
        "a_compared_constant",
        1,
        "r",
        "signal r : unsigned(0 downto 0);",
        f'r <= "1" when x(63 downto 0) = {_JOINED} else "0";',
    ),
    _design("a_result", 64, "x(63 downto 0) xor shifted(40)", _CONSTANTS),
    _instances(
        "of_a_generic",
        1,
        f"part : entity work.of_a_generic_part generic map (G => {_JOINED}) port map (a => r(0), y => r(1));",
    ),
    _instances("a_default", 1, "part : entity work.a_default_part port map (a => r(0), y => r(1));", default=_JOINED),
    _instances("by_position", 1, f"part : entity work.by_position_part port map (r(0), {_JOINED}, y => r(1));"),
    _instances(
        "upwards", 1, "part : entity work.upwards_part port map (r(0), c => (0 => '1', others => '0'), y => r(1));"
    ),
    # The value depends on the iteration, and so the zeros are ambiguous.
    _instances(
        "iterations",
        2,
        "g : for i in 1 to 2 generate\npart : entity work.iterations_part\n"
        "port map (a => r(i - 1), b => shifted(40 + i), y => r(i)); end generate;",
        _CONSTANTS,
    ),
]
KEPT += [
    _instances(
        "ascending",
        1,
        "part : entity work.ascending_part\n"
        "port map (a => r(0), b => r(0), c => (62 => '1', others => '0'), y => r(1));",
        default=_JOINED,
    )
]

# An integer without bits.
CRASH = _design(
    "crash", 8, "to_unsigned(j, 8)", "signal j : integer range 0 to 0 := 0;", "j <= to_integer(u(7 downto 0)) mod 1;"
)


def growing(more: int) -> Design:
    """Assignments to bits of signals, so many that a table of GHDL grows in the midst of one or between two."""
    signals = [f"a{number}" for number in range(10)]
    declarations = "".join(f"signal {name} : std_logic_vector(127 downto 0);\n" for name in [*signals, "b", "c"])
    first = "".join(f"b({bit}) <= x({bit});\n" for bit in range(more))
    bits = "".join(f"{{0}}({bit}) <= not x({bit});\n" for bit in range(1, 127, 2))
    each = "".join(f"process (x) begin {name} <= x;\n{bits.format(name)}end process;\n" for name in signals)
    others = f"process (x) begin b <= x;\n{first}end process;\n"
    return _design(f"growing{more}", 128, " xor ".join([*signals, "b"]), declarations, others + each)


# A register whose reset value GHDL's netlist has wrong.
MIXED = _design(
    "mixed",
    8,
    "r",
    "signal r : std_logic_vector(7 downto 0);",
    _clocked("if rst = '1' then r <= X\"82\"; else r(7 downto 3) <= x(7 downto 3); end if;"),
)
