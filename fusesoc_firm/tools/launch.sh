# Start a program of a step whose result is stored: sh launch.sh PYTHON -m fusesoc_firm.tools.launcher PROGRAM ARGUMENT...
#
# An installed program is started from here, since a start of Python takes longer than many a step; its name is left for
# the build's manifest. The package's launcher finds programs of PyPI, and names the package of a missing one.
python=$1
shift 3
if command -v "$1" >/dev/null; then
  echo "$1" >>"$TMPDIR/firm_launched"
  exec "$@"
fi
exec "$python" -m fusesoc_firm.tools.launcher "$@"
