# Start a program of a build, in the build's work folder: sh firm_launcher.sh PROGRAM ARGUMENT...
#
# The package's launcher finds programs of PyPI, names the package of a missing one, and records each program in
# manifest.json. It is in Python, whose start takes longer than many steps of a build, so it runs rarely:
#
# * In a build's folder, it writes the path of each recorded program to .firm_noted. Until FuseSoC sets the build up
#   again, that file changes or the manifest is removed, the program is started from here.
# * In the user's cache, it writes a note of each program: the entries of the manifest, and the files that they depend
#   on. While these are unchanged, other builds use the note.
#
# Programs that were built here, such as ./Vtop, and mkdir, which is not a tool of a build, are started from here, and
# so are all programs if no Python has the package.
program=$1
case $program in
  mkdir | */*) exec "$@" ;;
esac

noted=.firm_noted/$program
found=$(command -v "$program")
if [ -s manifest.json ] && [ "$noted" -nt Makefile ] && read -r path <"$noted" && [ "$path" = "$found" ] &&
  [ "$(find -L "$path" ! -cnewer "$noted" 2>/dev/null)" = "$path" ]; then
  exec "$@"
fi

# Set `environment` to the variables and the command line of FuseSoC, above make, which determine the Python with the
# package.
read_environment() {
  process=$PPID
  while read -r _ name _ above _ <"/proc/$process/stat"; do
    case $name in
      '(make)' | '(gmake)' | '(sh)' | '(dash)' | '(bash)') process=$above ;;
      *) break ;;
    esac
  done
  words=$(tr '\0\n' '\n ' <"/proc/$process/cmdline" | sed 'N; s/\n/ /; q') && [ -n "$words" ] || return
  case $words in
    /*' /'*) ;;
    *) words="$words $(readlink "/proc/$process/cwd")" || return ;;
  esac
  environment="$PATH $PYTHONPATH $FUSESOC_FIRM_PYTHON $words"
}

# Add the entries of a note to the manifest, which is locked.
add_to_manifest() {
  [ -s manifest.json ] && manifest=manifest.json || manifest=/dev/null
  LC_ALL=C awk '
    /^    "/ { name = $0; text[name] = ""; comma = "" }
    /^    / { line = $0; sub(/^    },$/, "    }", line); text[name] = text[name] comma line; comma = "\n" }
    END {
      print "{\n  \"tools\": {"
      for (name in text) {
        for (i = ++count; i > 1 && names[i - 1] > name; i--) names[i] = names[i - 1]
        names[i] = name
      }
      for (i = 1; i <= count; i++) print text[names[i]] (i < count ? "," : "")
      print "  }\n}"
    }' "$manifest" "$note" >manifest.part || return
  if [ -s manifest.json ] && cmp -s manifest.part manifest.json; then rm manifest.part; else mv manifest.part manifest.json; fi
}

# Use the user's note of the program. Fail unless it is valid here. Its lines: the environment, the package's folder,
# the files that the entries depend on, the program first, an empty line, and the entries.
take_note() {
  [ -f "$note" ] || return
  set --
  {
    IFS= read -r known && IFS= read -r package
    while IFS= read -r line && [ -n "$line" ]; do set -- "$@" "$line"; done
  } <"$note"
  [ "$known" = "$environment" ] && [ "$1" = "$found" ] || return
  newer=$(find "$@" -maxdepth 0 -cnewer "$note" 2>&1; find "$package" -name __pycache__ -prune -o -cnewer "$note" -print 2>&1)
  [ -z "$newer" ] && { [ -d .firm_noted ] || mkdir .firm_noted; } && (flock 9 && add_to_manifest) 9<. && echo "$1" >"$noted"
}

# Outputs to remove after a failure, see the package's launcher.
note=
environment=
case " $* " in
  *' --asc '* | *' --textcfg '* | *' --write '*) ;;
  *)
    cache=${FUSESOC_FIRM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/fusesoc_firm}
    if read_environment 2>/dev/null; then
      note=$cache/programs/$program
      take_note 2>/dev/null && exec "$@"
    fi
    ;;
esac

python=$(python3 firm_python.py)
[ -n "$python" ] || exec "$@"
FIRM_NOTED=$noted FIRM_NOTE=$note FIRM_ENVIRONMENT=$environment exec "$python" -m fusesoc_firm.tools.launcher "$@"
