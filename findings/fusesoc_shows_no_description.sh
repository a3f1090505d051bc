#!/bin/sh
# Guess:    `fusesoc core show` prints the description that each target of a core has.
# Really:   it prints `<No description>`, unless the description contains the word "description".
# Versions: FuseSoC 2.4.7 with Edalize 0.6.8; 2.4.5 and 2.4.6 do the same
# Source:   `info` in fusesoc/capi2/core.py looks for the key "description" in the text of the description.
# Met by:   everybody who asks a core for its targets
# Instead:  read the .core
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export HOME="$work"  # FuseSoC creates folders there.
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install fusesoc==2.4.7 edalize==0.6.8
cat > top.core <<'CORE'
CAPI=2:
name: example:sim:top:1
targets:
  default: {toplevel: top}
  lint: {toplevel: top, description: Look for doubtful code}
  sim: {toplevel: top, description: Simulate the description of the hardware}
CORE
touch fusesoc.conf
env/bin/fusesoc --config fusesoc.conf --cores-root . core show example:sim:top > log 2>&1 || { cat log; exit 1; }
env/bin/pip list 2> /dev/null | grep -E '^(fusesoc|edalize) '
echo "guess: 'Look for doubtful code' and 'Simulate the description of the hardware'"
sed -n 's/^\(lint\|sim\) /seen:  &/p' log
grep -q '^lint *: <No description>$' log && grep -q '^sim *: Simulate the description of the hardware$' log
