#!/bin/sh
# Guess:    a folder in a fileset is copied to the build with its files, as FuseSoC copies folders by `shutil.copytree`.
# Really:   the export then removes all files that the fileset does not name, as left by an earlier build: the folder of
#           the build is empty, and so is its copy of `copyto`. FuseSoC ends with 0, without a message.
# Versions: FuseSoC 2.4.7
# Source:   `CoreInterface.export` in fusesoc/capi2/core.py
# Met by:   authors of cores with a folder of test data or scripts
# Instead:  list each file, or use --no-export
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install fusesoc==2.4.7 edalize==0.6.8
export HOME="$work"  # FuseSoC creates folders there.

mkdir data
echo 42 > data/values.txt
cat > top.core <<'CORE'
CAPI=2:
name: example:lib:top:1
filesets:
  rtl: {files: [top.v: {file_type: verilogSource}, data: {file_type: user, copyto: data}]}
targets:
  sim: {filesets: [rtl], toplevel: top, flow: sim, flow_options: {tool: icarus}}
CORE
echo 'module top; endmodule' > top.v
printf '[main]\ncache_root = %s\n' "$work/cache" > fusesoc.conf
PATH=$work/env/bin:$PATH fusesoc --config fusesoc.conf --cores-root . run --setup --target=sim example:lib:top > log 2>&1 \
  || { cat log; exit 1; }
folders=$(find build -type d -name data | wc -l)
files=$(find build -name values.txt | wc -l)
env/bin/pip list 2> /dev/null | grep '^fusesoc '
echo "guess: the build has two folders 'data', each with values.txt"
echo "seen:  FuseSoC ended with 0, and the build has $folders folders and $files files"
[ "$folders" = 2 ] && [ "$files" = 0 ]
! grep -qE 'WARNING|ERROR' log
