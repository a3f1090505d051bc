#!/bin/sh
# Guess:    a foreign subprogram with `VHPIDIRECT libc.so.6 fflush` works with every back end of GHDL, since the dynamic
#           linker knows libc.so.6.
# Really:   mcode loads the library by this name; without a library, it does not find the function. LLVM passes the name
#           to the linker as a file of the current folder and fails; without a library, it works. Neither form works
#           with both.
# Versions: GHDL 2.0.0 with mcode and LLVM; the same with GCC
# Met by:   authors of benches that call C, on arm64, for which Debian has LLVM and GCC only
# Instead:  put a linker script of this name into the folder: `INPUT(-lc)`
set -eu
for backend in mcode llvm; do
  command -v ghdl-$backend > /dev/null || { echo "needs the package ghdl-$backend" >&2; exit 2; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

run() { # BACKEND, LIBRARY or nothing: whether the bench ends normally
  rm -rf "$1" && mkdir "$1" && cd "$1"
  [ ! -e ../libc.so.6 ] || cp ../libc.so.6 .
  cat > bench.vhd <<VHDL
entity bench is
end entity bench;

architecture sim of bench is
  procedure flush (stream : integer);
  attribute foreign of flush : procedure is "VHPIDIRECT ${2:+$2 }fflush";

  procedure flush (stream : integer) is
  begin
    assert false report "VHPIDIRECT is not supported" severity failure;
  end procedure flush;
begin
  process
  begin
    flush(0);
    report "flushed";
    wait;
  end process;
end architecture sim;
VHDL
  result=fails
  if { ghdl-"$1" -a bench.vhd && ghdl-"$1" -e bench && ghdl-"$1" -r bench; } > log 2>&1 && grep -q flushed log; then
    result=works
  fi
  cd ..
}

ghdl-mcode --version | head -n 1
echo "guess: both back ends work with libc.so.6"
seen=
for library in libc.so.6 ""; do
  for backend in mcode llvm; do
    run $backend "$library"
    echo "$backend, library '${library:-none}': $result"
    seen="$seen $result"
  done
done
echo "INPUT(-lc)" > libc.so.6
for backend in mcode llvm; do
  run $backend libc.so.6
  echo "$backend, library 'libc.so.6' with the linker script: $result"
  seen="$seen $result"
done
[ "$seen" = " works fails fails works works works" ]
