"""The environment of a step: the variables that it receives, and those that determine its result."""

from __future__ import annotations

from collections.abc import Mapping

# Variables of a terminal, a login or a job, which differ from session to session. A step does not receive them.
_SESSION = frozenset(
    "_ OLDPWD PWD SHLVL TERM TTY COLUMNS LINES COLORTERM DISPLAY XAUTHORITY HOSTNAME MAIL LS_COLORS LESSOPEN LESSCLOSE "
    "PS1 PROMPT_COMMAND HISTFILE HISTSIZE MAKEFLAGS MFLAGS MAKELEVEL MAKE_TERMOUT MAKE_TERMERR INVOCATION_ID "
    "JOURNAL_STREAM BUILD_ID BUILD_NUMBER BUILD_TAG BUILD_URL".split()
)
_OF_SESSION = tuple(
    "ACTIONS_ CI_ DBUS_ FUSESOC_FIRM_ACTIONS FUSESOC_FIRM_CACHE FUSESOC_FIRM_REMOTE GITHUB_ GIT_ GPG_ PYTEST_ RUNNER_ "
    "SSH_ SUDO_ TERM_ TMUX VSCODE_ VTE_ WAYLAND_ WINDOWID XDG_RUNTIME XDG_SESSION".split()
)
# Variables that contain paths. Their effect is observed: the programs that run, and the files that are read.
_UNKEYED = frozenset("CCACHE_DIR HOME LOGNAME PATH TMPDIR USER XDG_CACHE_HOME XDG_STATE_HOME".split())


def of_step(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a step: that of the session, without variables that differ between sessions."""
    return {
        name: value for name, value in environment.items() if name not in _SESSION and not name.startswith(_OF_SESSION)
    }


def key_of(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables of a step's environment that determine its result."""
    return {name: value for name, value in sorted(of_step(environment).items()) if name not in _UNKEYED}
