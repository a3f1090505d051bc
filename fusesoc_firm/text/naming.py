"""Convert ROS names to legal, distinct names in VHDL, Verilog and SystemVerilog.

Names are unchanged if possible. Changes are the same on every run. A comment in the generated code contains the ROS
name of each port, so that the mapping can be reversed.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence

# IEEE 1076-2008, IEEE 1364-2005 and IEEE 1800-2017: a name must be legal in every language of a target.
VHDL_KEYWORDS = frozenset(
    """abs access after alias all and architecture array assert assume assume_guarantee attribute begin block body
    buffer bus case component configuration constant context cover default disconnect downto else elsif end entity
    exit fairness file for force function generate generic group guarded if impure in inertial inout is label library
    linkage literal loop map mod nand new next nor not null of on open or others out package parameter port postponed
    procedure process property protected pure range record register reject release rem report restrict
    restrict_guarantee return rol ror select sequence severity shared signal sla sll sra srl strong subtype then to
    transport type unaffected units until use variable vmode vprop vunit wait when while with xnor xor""".split()
)
VERILOG_KEYWORDS = frozenset(
    """accept_on alias always always_comb always_ff always_latch and assert assign assume automatic before begin bind
    bins binsof bit break buf bufif0 bufif1 byte case casex casez cell chandle checker class clocking cmos config const
    constraint context continue cover covergroup coverpoint cross deassign default defparam design disable dist do edge
    else end endcase endchecker endclass endclocking endconfig endfunction endgenerate endgroup endinterface endmodule
    endpackage endprimitive endprogram endproperty endspecify endsequence endtable endtask enum event eventually expect
    export extends extern final first_match for force foreach forever fork forkjoin function generate genvar global
    highz0 highz1 if iff ifnone ignore_bins illegal_bins implements implies import incdir include initial inout input
    inside instance int integer interconnect interface intersect join join_any join_none large let liblist library
    local localparam logic longint macromodule matches medium modport module nand negedge nettype new nexttime nmos nor
    noshowcancelled not notif0 notif1 null or output package packed parameter pmos posedge primitive priority program
    property protected pull0 pull1 pulldown pullup pulsestyle_ondetect pulsestyle_onevent pure rand randc randcase
    randsequence rcmos real realtime ref reg reject_on release repeat restrict return rnmos rpmos rtran rtranif0
    rtranif1 s_always s_eventually s_nexttime s_until s_until_with scalared sequence shortint shortreal showcancelled
    signed small soft solve specify specparam static string strong strong0 strong1 struct super supply0 supply1
    sync_accept_on sync_reject_on table tagged task this throughout time timeprecision timeunit tran tranif0 tranif1
    tri tri0 tri1 triand trior trireg type typedef union unique unique0 unsigned until until_with untyped use uwire var
    vectored virtual void wait wait_order wand weak weak0 weak1 while wildcard wire with within wor xnor xor""".split()
)
KEYWORDS = VHDL_KEYWORDS | VERILOG_KEYWORDS

# The libraries, and the declarations of std.standard, std_logic_1164 and numeric_std. In a package imported with
# `.all`, a constant with one of these names would hide the predefined name: `severity error`, for example, would no
# longer compile.
VHDL_PREDEFINED = frozenset(
    """ack bel bit bit_vector boolean boolean_vector bs can character cr dc1 dc2 dc3 dc4 del delay_length dle em enq eot
    error esc etb etx failure false ff file_open_kind file_open_status firm foreign fs fsp gs gsp hr ht ieee integer
    integer_vector lf maximum min minimum mode_error ms nak name_error natural note now ns nul numeric_std open_ok
    positive ps read_mode real real_vector rs rsp sec severity_level si so soh standard status_error std std_logic
    std_logic_1164 std_logic_vector std_ulogic std_ulogic_vector string stx sub syn time time_vector true us usp ux01
    ux01z vt warning work write_mode append_mode x01 x01z resolved falling_edge rising_edge is_x to_bit to_bitvector
    to_bstring to_hstring to_ostring to_stdlogicvector to_stdulogic to_stdulogicvector to_string to_01 to_integer
    to_signed to_unsigned to_ux01 to_x01 to_x01z find_leftmost find_rightmost resize rotate_left rotate_right
    shift_left shift_right signed std_match unresolved_signed unresolved_unsigned unsigned""".split()
)

# The maximum length of a name or description, in characters.
LONGEST_TEXT = 200
# The maximum length of a path, such as the path of a source file or of a field in a deeply nested message.
LONGEST_PATH = 4096

PREFIX_RULE = "at most 100 lower-case letters, digits and single '_' between them, starting with a letter"
"""The form of a legal prefix of design units."""

_PREFIX = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
_LONGEST_PREFIX = 100
_ILLEGAL = re.compile(r"[^A-Za-z0-9_]")
_UNDERSCORES = re.compile(r"_{2,}")


def text_fault(text: str, longest: int = LONGEST_TEXT) -> tuple[str, str] | None:
    """Return the reason why `text` cannot be a name or description and the legal form, or None if `text` is valid.

    The text appears in comments, strings, labels and messages, so it must be one printable line. It must not contain
    control characters, Unicode line ends, lone surrogates, or characters that change the writing direction.
    """
    legal = f"legal: one line of at most {longest} printable characters"
    if len(text) > longest:
        return f"has {len(text)} characters", legal
    if unprintable := next((character for character in text if not character.isprintable()), None):
        return f"contains the character U+{ord(unprintable):04X}", legal
    return None


def identifier(*parts: str, avoid: Container[str] = KEYWORDS, suffix: str = "field") -> str:
    """Join the parts with `_` and return a legal identifier.

    The identifier has no `__`, no `_` at either end and no leading digit. If it equals a word in `avoid` (in lower
    case), the suffix is added; by default, `avoid` contains the keywords of VHDL and Verilog.
    """
    joined = _UNDERSCORES.sub("_", _ILLEGAL.sub("_", "_".join(parts))).strip("_")
    if not joined or joined[0].isdigit():
        joined = f"n{joined}"
    return f"{joined}_{suffix}" if joined.lower() in avoid else joined


def distinct_identifiers(names: Iterable[Sequence[str]], reserved: Iterable[str] = ()) -> list[str]:
    """Return an identifier for each name, in order; all differ from each other and from `reserved` in more than case.

    VHDL does not distinguish `Stamp` from `stamp`; ROS does. If a name clashes with an earlier name or with a port of
    the entity, the function adds the first free suffix of `_2`, `_3`, ...
    """
    return _distinct((identifier(*name) for name in names), reserved)


def distinct_constants(names: Iterable[Sequence[str]], reserved: Iterable[str] = ()) -> list[str]:
    """Return identifiers for constants like `distinct_identifiers`, but in capitals and not predefined in VHDL.

    `STATUS_OK` is unchanged; `ERROR` and `IN` become `ERROR_VALUE` and `IN_VALUE`.
    """
    avoided = VHDL_KEYWORDS | VHDL_PREDEFINED
    return _distinct((identifier(*name, avoid=avoided, suffix="value").upper() for name in names), reserved)


def _distinct(bases: Iterable[str], reserved: Iterable[str]) -> list[str]:
    taken = {word.lower() for word in reserved}
    chosen = []
    for base in bases:
        candidate, number = base, 2
        while candidate.lower() in taken:
            candidate, number = f"{base}_{number}", number + 1
        taken.add(candidate.lower())
        chosen.append(candidate)
    return chosen


def is_prefix(text: str) -> bool:
    """Return whether a text may prefix the names of design units."""
    return len(text) <= _LONGEST_PREFIX and _PREFIX.fullmatch(text) is not None


def is_library(text: str) -> bool:
    """Return whether a text is a legal name for a VHDL library of generated files."""
    return is_prefix(text) and text not in VHDL_KEYWORDS and text not in ("ieee", "std", "work")


def prefixed(prefix: str, name: str) -> str:
    """Return `<prefix>_<name>`, or the name alone if the prefix is empty."""
    return f"{prefix}_{name}" if prefix else name


def entity_name(package: str, message: str) -> str:
    """Return the stem of a converter's entity and file, such as `geometry_msgs_quaternion`."""
    return identifier(package, message).lower()
