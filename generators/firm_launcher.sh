# Start a program of a build, in the build's work folder: sh firm_launcher.sh PROGRAM ARGUMENT...
#
# The package's launcher finds programs of PyPI, names the package of a missing one, and notes in manifest.json which
# one has run. It is in Python, whose start takes longer than many a step of a build. So it leaves the path of a program
# that it has noted in .firm_noted, and until FuseSoC sets the build up again, that file changes or the manifest is
# removed, the program is started from here. So is what was built here, such as ./Vtop, and everything if no Python has
# the package.
program=$1
case $program in
  */*) exec "$@" ;;
esac

noted=.firm_noted/$program
if [ -s manifest.json ] && [ "$noted" -nt Makefile ] && read -r path <"$noted" &&
  [ "$path" = "$(command -v "$program")" ] &&
  [ "$(find -L "$path" ! -cnewer "$noted" 2>/dev/null)" = "$path" ]; then
  exec "$@"
fi

python=$(python3 firm_python.py)
[ -n "$python" ] || exec "$@"
FIRM_NOTED=$noted exec "$python" -m fusesoc_firm.tools.launcher "$@"
