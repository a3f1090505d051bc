#!/bin/sh
# Guess:    a netlist that `ghdl --synth` writes computes what GHDL simulates.
# Really:   `100 - s`, an integer minus a signed number, becomes `s - 100` in the netlist, without a message. An integer
#           minus an unsigned number is right.
# Versions: GHDL 2.0.0 (Debian 12) and 5.0.1 (Debian 13); simulation and netlist by the same program
# Source:   `Iir_Predefined_Ieee_Numeric_Std_Sub_Int_Sgn` in src/synth/synth-vhdl_oper.adb
# Met by:   everyone who gives VHDL to Yosys or a Verilog simulator by way of GHDL
# Instead:  to_signed(100, s'length) - s
set -eu
command -v ghdl > /dev/null || { echo "needs GHDL, such as Debian 12: apt-get install ghdl-mcode=2.0.0+dfsg-6.2+b2" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

cat > distance.vhd <<'VHDL'
library ieee;
use ieee.numeric_std.all;

entity distance is
  port (s : in signed(15 downto 0); u : in unsigned(15 downto 0);
    from_s : out signed(15 downto 0); from_u : out unsigned(15 downto 0));
end entity distance;

architecture rtl of distance is
begin
  from_s <= 100 - s;
  from_u <= 100 - u;
end architecture rtl;
VHDL
cat > bench.vhd <<'VHDL'
library ieee;
use ieee.numeric_std.all;

entity bench is
end entity bench;

architecture sim of bench is
  signal s, from_s : signed(15 downto 0) := to_signed(30, 16);
  signal u, from_u : unsigned(15 downto 0) := to_unsigned(30, 16);
begin
  dut : entity work.distance port map (s => s, u => u, from_s => from_s, from_u => from_u);
  process
  begin
    wait for 1 ns;
    report "100 - 30: signed " & integer'image(to_integer(from_s)) & ", unsigned " & integer'image(to_integer(from_u));
    wait;
  end process;
end architecture sim;
VHDL
simulate() {  # the folder of the library, then the files
  library=$1
  shift
  mkdir "$library"
  ghdl -a --workdir="$library" "$@" 2> log || { cat log; exit 1; }
  ghdl -e --workdir="$library" bench
  ghdl -r --workdir="$library" bench 2>&1 | grep -o '100 - 30.*'
}
source=$(simulate source distance.vhd bench.vhd)
ghdl --synth --workdir=source --out=vhdl distance > netlist.vhd
# The netlist has an architecture only for the entity of the source.
netlist=$(simulate netlist distance.vhd netlist.vhd bench.vhd)
ghdl --version | head -n 1
echo "guess: the same values, 70 and 70"
echo "seen:  source:  $source"
echo "       netlist: $netlist"
[ "$source" = "100 - 30: signed 70, unsigned 70" ] && [ "$netlist" = "100 - 30: signed -70, unsigned 70" ]
