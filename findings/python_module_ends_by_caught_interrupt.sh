#!/bin/sh
# Guess:    a program that catches `KeyboardInterrupt` and calls `sys.exit(3)` ends with the status 3.
# Really:   started by `python3 -m`, it ends by SIGINT (a shell reports 130) if Ctrl-C came within `exec` of a string;
#           started by its file, it ends with 3. The decorator `dataclass` calls `exec` so, hence many imports do.
# Versions: Python 3.11.2
# Source:   `_Py_UnhandledKeyboardInterrupt` in Python/pythonrun.c and Modules/main.c
# Met by:   authors of commands with `__main__.py` that have an exit status of their own for Ctrl-C
# Instead:  accept both statuses, or end with `os._exit`
set -eu
command -v python3 > /dev/null || { echo "needs the package python3" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > program.py <<'PYTHON'
import os
import signal
import sys

signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    exec("os.kill(os.getpid(), signal.SIGINT)\nfor _ in range(1000): pass")
except KeyboardInterrupt:
    print("caught")
sys.exit(3)
PYTHON
file=0
python3 program.py || file=$?
module=0
python3 -m program || module=$?
python3 --version
echo "guess: 3 from the file, 3 from the module"
echo "seen:  $file from the file, $module from the module"
[ "$file" = 3 ] && [ "$module" = 130 ]
