#!/bin/sh
# Guess:    `ghdl --synth` refuses a latch, as it does without `--latches`.
# Really:   GHDL 2.0.0 refuses it only if the latch is an output. A signal inside of the architecture becomes a constant
#           X in the netlist: no message, exit status 0. GHDL 5.0.1 refuses both.
# Versions: GHDL 2.0.0 (Debian 12) and 5.0.1 (Debian 13)
# Met by:   everyone who gives VHDL to Yosys or a Verilog simulator by way of GHDL, as Debian 12 has it
# Instead:  search the netlist for signals that are always X
set -eu
command -v ghdl > /dev/null || { echo "needs GHDL, such as Debian 12: apt-get install ghdl-mcode=2.0.0+dfsg-6.2+b2" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

entity() {  # the target of the latch, then further declarations and statements
  cat <<VHDL
library ieee;
use ieee.std_logic_1164.all;

entity hold is
  port (a, enable : in std_logic; q : out std_logic);
end entity hold;

architecture rtl of hold is
  $2
begin
  $3
  process (a, enable)
  begin
    if enable = '1' then
      $1 <= a;
    end if;
  end process;
end architecture rtl;
VHDL
}
synthesise() {
  if ghdl --synth --out=verilog "$1.vhd" -e hold > "$1.v" 2> "$1.log"; then
    grep -o "assign .* = 1'bX" "$1.v" || echo "a netlist without X"
  else
    grep -oh "latch infered for net .." "$1.log" "$1.v" | head -n 1
  fi
}
entity q "" "" > output.vhd
entity held "signal held : std_logic;" "q <= held;" > inside.vhd
output=$(synthesise output)
inside=$(synthesise inside)
ghdl --version | head -n 1
echo "guess: both are refused"
echo "seen:  output: $output"
echo "       inside: $inside"
case $(ghdl --version) in
  "GHDL 2."*) wanted="assign held = 1'bX" ;;
  *) wanted='latch infered for net "h' ;;
esac
[ "$output" = 'latch infered for net "q' ] && [ "$inside" = "$wanted" ]
