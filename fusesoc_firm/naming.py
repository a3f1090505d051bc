"""ROS names to names that are legal and distinct in VHDL, Verilog and SystemVerilog.

A name stays as it is wherever it can. What has to change changes in the same way on every run, and the
generated code says in a comment which ROS name a port stands for, so the mapping can be read backwards.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

# IEEE 1076-2008, IEEE 1364-2005 and IEEE 1800-2017: a name must be usable whatever target translates it.
_VHDL_KEYWORDS = frozenset(
    """abs access after alias all and architecture array assert assume assume_guarantee attribute begin block body
    buffer bus case component configuration constant context cover default disconnect downto else elsif end entity
    exit fairness file for force function generate generic group guarded if impure in inertial inout is label library
    linkage literal loop map mod nand new next nor not null of on open or others out package parameter port postponed
    procedure process property protected pure range record register reject release rem report restrict
    restrict_guarantee return rol ror select sequence severity shared signal sla sll sra srl strong subtype then to
    transport type unaffected units until use variable vmode vprop vunit wait when while with xnor xor""".split()
)
_VERILOG_KEYWORDS = frozenset(
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
KEYWORDS = _VHDL_KEYWORDS | _VERILOG_KEYWORDS

_ILLEGAL = re.compile(r"[^A-Za-z0-9_]")
_UNDERSCORES = re.compile(r"_{2,}")


def identifier(*parts: str) -> str:
    """One legal identifier of the parts joined with `_`.

    It has no `__`, no `_` at its ends and no digit in front, and is no keyword of VHDL or Verilog.
    """
    joined = _UNDERSCORES.sub("_", _ILLEGAL.sub("_", "_".join(parts))).strip("_")
    if not joined or joined[0].isdigit():
        joined = f"n{joined}"
    return f"{joined}_field" if joined.lower() in KEYWORDS else joined


def distinct_identifiers(names: Iterable[Sequence[str]], reserved: Iterable[str] = ()) -> list[str]:
    """An identifier for each name, in order, distinct without regard to case and none of `reserved`.

    VHDL does not tell `Stamp` from `stamp`; ROS does. A clash, with an earlier name or with a port of the
    entity, is solved by the first free of `_2`, `_3`, ...
    """
    taken = {word.lower() for word in reserved}
    chosen = []
    for name in names:
        base = identifier(*name)
        candidate, number = base, 2
        while candidate.lower() in taken:
            candidate, number = f"{base}_{number}", number + 1
        taken.add(candidate.lower())
        chosen.append(candidate)
    return chosen


def entity_name(package: str, message: str) -> str:
    """`geometry_msgs`, `Quaternion` -> `geometry_msgs_quaternion`: the stem of a converter's entity and file."""
    return identifier(package, message).lower()
