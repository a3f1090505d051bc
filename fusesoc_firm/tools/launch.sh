# Start a program of a step whose result is stored: sh launch.sh PYTHON -m fusesoc_firm.tools.launcher PROGRAM ARGUMENT...
#
# An installed program is started directly, since starting Python takes longer than many steps, and is recorded for the
# build's manifest. The package's launcher finds programs from PyPI, and reports the package of a missing program.
python=$1
shift 3
if command -v "$1" >/dev/null; then
  echo "$1" >>"$TMPDIR/firm_launched"
  exec "$@"
fi
exec "$python" -m fusesoc_firm.tools.launcher "$@"
