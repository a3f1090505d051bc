#!/bin/sh
# Guess:    the tags of files and filesets arrive in the description of the build, where tools read them, such as
#           `simulation`, which keeps a test bench out of Vivado's synthesis.
# Really:   FuseSoC 2.4.7 loses all tags without a message; 2.4.6 passes them on.
# Versions: FuseSoC 2.4.6 and 2.4.7 with Edalize 0.6.8
# Source:   `get_files` in fusesoc/capi2/core.py keeps attributes that are a list; tags are a tuple since 2.4.7.
# Met by:   authors of cores with `tags: [simulation]`, of Edalize's tools, and of flows that read tags
# Instead:  separate filesets, which only the targets of simulations use
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export HOME="$work"  # FuseSoC creates folders there.
echo "module top; endmodule" > top.v
echo "module bench; endmodule" > bench.v
cat > top.core <<'CORE'
CAPI=2:
name: example:sim:top:1
filesets:
  rtl: {files: [top.v: {file_type: verilogSource, tags: [of_file]}]}
  tb: {files: [bench.v: {file_type: verilogSource}], tags: [simulation]}
targets:
  default: {filesets: [rtl, tb], toplevel: top, flow: sim, flow_options: {tool: icarus}}
CORE
touch fusesoc.conf
for version in 2.4.6 2.4.7; do
  python3 -m venv --clear env || { echo "needs the package python3-venv" >&2; exit 2; }
  env/bin/pip --quiet install "fusesoc==$version" edalize==0.6.8
  rm -rf build
  env/bin/fusesoc --config fusesoc.conf --cores-root . run --setup example:sim:top > log 2>&1 || { cat log; exit 1; }
  env/bin/pip list 2> /dev/null | grep -E '^(fusesoc|edalize) '
  tags=$(grep -cE '^ +- (of_file|simulation)$' build/*/*/*.eda.yml || true)
  echo "guess: 2 tags in the description of the build"
  echo "seen:  $tags tags, and FuseSoC ended with 0"
  eval "tags_$(echo "$version" | tr . _)=$tags"
done
[ "$tags_2_4_6" = 2 ] && [ "$tags_2_4_7" = 0 ]
