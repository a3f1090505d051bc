#!/bin/sh
# Guess:    the core that a generator writes is a core like others, so the cores in its `depend` join the build.
# Really:   FuseSoC ignores `depend` in a generated core, without a message. The files are missing in the build, and
#           even the name of a core that does not exist is accepted.
# Versions: FuseSoC 2.4.7
# Source:   FuseSoC's documentation says so, in "Generators"; issue 560 of olofk/fusesoc
# Met by:   authors of generators whose output instantiates modules of a library
# Instead:  the core that declares the generator depends on the library
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install fusesoc==2.4.7 edalize==0.6.8
export HOME="$work"  # FuseSoC creates folders there.

cat > generate.py <<'PYTHON'
import sys

import yaml

with open(sys.argv[1]) as file:
    name = yaml.safe_load(file)["vlnv"]
with open("wrapper.v", "w") as file:
    file.write("module wrapper; part u_part (); endmodule\n")
with open("wrapper.core", "w") as file:
    file.write(f"""CAPI=2:
name: {name}
filesets:
  rtl:
    files: [wrapper.v: {{file_type: verilogSource}}]
    depend: [example:lib:part, example:lib:no_such_core]
targets:
  default: {{filesets: [rtl]}}
""")
PYTHON
cat > generator.core <<'CORE'
CAPI=2:
name: example:lib:generator:1
generators:
  wrapper: {interpreter: python3, command: generate.py}
CORE
cat > part.core <<'CORE'
CAPI=2:
name: example:lib:part:1
filesets:
  rtl: {files: [part.v: {file_type: verilogSource}]}
targets:
  default: {filesets: [rtl]}
CORE
cat > top.core <<'CORE'
CAPI=2:
name: example:lib:top:1
filesets:
  rtl: {files: [top.v: {file_type: verilogSource}], depend: [example:lib:generator]}
generate:
  made: {generator: wrapper}
targets:
  sim: {filesets: [rtl], generate: [made], toplevel: top, flow: sim, flow_options: {tool: icarus}}
CORE
echo 'module top; wrapper u_wrapper (); endmodule' > top.v; echo 'module part; endmodule' > part.v
printf '[main]\ncache_root = %s\n' "$work/cache" > fusesoc.conf
PATH=$work/env/bin:$PATH fusesoc --config fusesoc.conf --cores-root . run --setup --target=sim example:lib:top > log 2>&1 \
  || { cat log; exit 1; }
files=$(find build -name '*.eda.yml' -exec cat {} + | grep -oE '(part|top|wrapper)\.v' | sort | tr '\n' ' ')
env/bin/pip list 2> /dev/null | grep '^fusesoc '
echo "guess: the build has part.v top.v wrapper.v, or an error about example:lib:no_such_core"
echo "seen:  FuseSoC ended with 0, and the build has $files"
[ "$files" = "top.v wrapper.v " ]
! grep -qE 'WARNING|ERROR' log
