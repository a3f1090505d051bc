#!/bin/sh
# Guess:    if the newest version of a core needs a core that no library has, FuseSoC ends with an error that names the
#           missing core, as it does if there is only one version.
# Really:   FuseSoC uses the newest version that lacks nothing. No message says so, and the exit status is 0, so an
#           incomplete checkout of libraries builds other sources.
# Versions: FuseSoC 2.4.7
# Source:   `CoreDB.solve` in fusesoc/coremanager.py gives all versions to the solver of simplesat, which prefers new
#           versions but need not take them
# Met by:   users of several libraries after an update that adds a dependency
# Instead:  require the version (`>=vendor:lib:core:2.0`), or compare the versions in the lines `INFO: Preparing`
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install fusesoc==2.4.7
export HOME="$work"  # FuseSoC creates folders there.
touch fusesoc.conf

core() { # NAME, VERSION, DEPENDENCY or nothing
  mkdir -p "cores/$1-$2"
  echo "// $1 $2" > "cores/$1-$2/$1.v"
  cat > "cores/$1-$2/$1.core" <<CORE
CAPI=2:
name: example:lib:$1:$2
filesets:
  rtl:
    files: [$1.v]
    file_type: verilogSource
    ${3:+depend: ["$3"]}
targets:
  default: {filesets: [rtl], toplevel: $1, default_tool: icarus}
CORE
}

setup() { # prints the messages
  rm -rf build
  env/bin/fusesoc --cores-root cores run --setup example:lib:top:1.0 2>&1
}

core leaf 1.0
core leaf 2.0 "example:lib:absent"
core top 1.0 "example:lib:leaf"
status=0
several=$(setup) || status=$?
used=$(cat build/example_lib_top_1.0/default-icarus/src/example_lib_leaf_*/leaf.v)
rm -r cores/leaf-1.0
single=0
alone=$(setup) || single=$?

echo "FuseSoC $(env/bin/fusesoc --version)"
echo "guess: the exit status is not 0, and the missing core is named"
echo "with version 1.0: exit status $status, sources of '$used', messages:"
echo "$several" | sed 's/^/  /'
echo "without it: exit status $single, messages:"
echo "$alone" | sed 's/^/  /'
[ "$status" -eq 0 ] && [ "$used" = "// leaf 1.0" ] && [ "$single" -ne 0 ] || exit 1
case "$several" in *absent* | *leaf:2* | *ERROR*) exit 1 ;; esac
case "$alone" in *absent*) ;; *) exit 1 ;; esac
