"""The verdict of a bench without a runner: by the simulator's messages, the bench's own lines and its sources.

A simulator exits with status 0 after an error message, after a bench that ended early, and after a bench that checked
nothing. docs/reference/verdicts.md describes the rules.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SEVERITIES = ("note", "warning", "error", "failure", "none")
"""The severities of messages; a message that is at least as severe as the flow option `fails_at` fails the test."""
FAILS_AT, PASSES_WITH = "fails_at", "passes_with"
"""Flow options of ours, which Edalize ignores."""

# Messages of GHDL; of Icarus Verilog; of Verilator; of nvc, ModelSim and their relatives.
_MESSAGES = tuple(
    map(
        re.compile,
        (
            r"\S.*:\d+:\d+:@\S+:\((?:assertion|report) (?P<severity>\w+)\): ",
            r"(?P<severity>INFO|WARNING|ERROR|FATAL): .*:\d+: ",
            r"(?:\[\S+\] )?[%-](?P<severity>Info|Warning|Error|Fatal): .*:\d+: ",
            r"(?:# )?\*\* (?P<severity>Note|Warning|Error|Failure|Fatal): ",
        ),
    )
)
_SYNONYMS = {"info": "note", "fatal": "failure"}
_ASSERT_LEVEL = "--assert-level="
# Words of a failure in capitals anywhere, or in a place where they say that something failed; 'no errors', '0 failed'
# and 'FAIL=0' are none.
_FAILURE = re.compile(
    r"\b(?:FAIL|FAILS|FAILED|FAILURE|FAILURES|ERROR|ERRORS|FATAL|MISMATCH|TIMED OUT|TIMEOUT(?!\s*[=:]?\s*\d))\b"
    r"|(?i:^\W*(?:\w+\W+){0,2}(?:fail|failed|failure|error|fatal|mismatch)\b(?=\s*[:!]|\s*$| at\b| in\b))"
    r"|(?i:\b(?:tests?|checks?|cases?|bench|simulation) (?:has |have )?failed\b|\bwatchdog\b|\btimed out\b)"
    r"|(?i:\b[1-9]\d* (?:\w+ )?(?:failed|failures?|errors?|mismatch|mismatches)\b(?=\s*$|\s*[,.;)!]))"
    r"|(?i:\b(?:failed|failures?|errors?|mismatches)\s*[:=]\s*[1-9])"
)
_NONE_BEFORE = re.compile(r"(?i)(?:\b0|\bno|\bwithout|\bnone|\bzero)(?: \w+)?[ =:]*$")
_NONE_AFTER = re.compile(r"(?i)[ a-z]{0,8}\W{0,3}\b(?:0+|none|no)\b(?![.\d])")
_PASS = re.compile(
    r"(?i)\bpass(?:ed|es)?\b|\bsuccess(?:ful|fully)?\b|\ball (?:\w+ )?(?:ok|good|done)\b"
    r"|\b(?:test|tests|testbench|bench|simulation) (?:\w+ )?(?:ok|done|complete|completed|finished|ended)\b"
    r"|\bend of (?:the )?(?:test|tests|testbench|bench|simulation)\b"
)
# Before a text of success: 'not passed', '0 tests passed', but not 'errors: 0, passed'.
_DENIED = re.compile(r"(?i)(?:(?<![:=])(?<![:=]\s)\b0|\bno|\bnot)(?: \w+)?\s*$")
_NO_SUCCESS = re.compile(r"(?i)\b(?:fail|not\b)")
# pytest's summary, also without its frame.
_PYTEST = re.compile(r"(?:=+ )?(?P<counts>\d+ [a-z]+(?:, \d+ [a-z]+)*|no tests ran) in [\d.]+s\b")
# What Edalize, make and simulators print of every run.
_NOISE = re.compile(
    r"\s*$|Entering directory|Leaving directory|make(?:\[\d+\])?: |INFO: (?:Running|Building|Setting up)"
    r"|(?:\S*sh \S+|.* -m fusesoc_firm\S*) (?:-m )?\S+ |(?:ghdl|vvp|nvc) -|\./V|\S*ghdl\S*:info: |FST info: |VCD info: "
    r"|simulation (?:finished|stopped) @|- \S+:\d+: Verilog \$finish|- (?:S i m u|Verilator|.*walltime)"
)
_CHECK = re.compile(
    r"(?i)\bassert\b|\bseverity\s+(?:error|failure)\b|\$(?:error|fatal|stop|finish_and_return)\b"
    r"|\b(?:stop|finish)\s*\(\s*[1-9]|\b(?:abort|exit)\s*\("
)
_STRING = re.compile(r'"((?:[^"\\\n]|\\.|"")*)"')
_COMMENT = {"vhdl": re.compile(r'("[^"\n]*")|--.*'), "": re.compile(r'("(?:[^"\\\n]|\\.)*")|//.*|/\*[\s\S]*?\*/')}
_FORMAT = re.compile(r"%[-\d.]*\w|\\[nt]")
_STOP = re.compile(r"\$stop\b")
# The host of a generated test bench, and its last line. Other lines contain texts of the user's messages.
_HOSTS, _HOSTS_PASS = ("/firm_sim_host.vhd", "/firm_sim_host.v"), "PASS"


@dataclass
class PlainBench:
    """A bench whose printed lines `see` receives; `passes_with` is a text that it must print, if not empty.

    If the text `is_declared`, other lines do not count as those of a failure.
    """

    fails_at: str
    passes_with: str
    is_declared: bool
    has_check: bool
    has_stop: bool = False
    _has_printed: bool = field(default=False, init=False)
    _has_passed: bool = field(default=False, init=False)
    _fault: str = field(default="", init=False)

    def see(self, line: str) -> None:
        """Take note of a printed line."""
        if _NOISE.match(line):
            return
        self._has_printed = True
        if not self._fault:
            self._fault = self._fault_of(line)
        before, text, _ = line.partition(self.passes_with) if self.passes_with else ("", "", "")
        self._has_passed = self._has_passed or bool(text and not _DENIED.search(before))

    def verdict(self) -> str:
        """Return why the test has not passed, or an empty text."""
        if self._fault:
            return self._fault
        if self.passes_with and not self._has_passed:
            return f"the bench ended before it printed '{self.passes_with}'"
        if not self._has_printed and not self.has_check:
            return "the bench printed nothing, and its sources check nothing"
        return ""

    def _fault_of(self, line: str) -> str:
        text = line
        for message in _MESSAGES:
            if found := message.match(line):
                severity = found["severity"].lower()
                severity = _SYNONYMS.get(severity, severity)
                if SEVERITIES.index(severity) >= SEVERITIES.index(self.fails_at):
                    return f"a message of the severity {severity}: {line.strip()}"
                if severity not in ("note", "warning"):
                    return ""
                text = line[found.end() :]
        if not self.is_declared and self.fails_at != "none" and _reports_failure(text):
            return f"the bench printed: {line.strip()}"
        if (summary := _PYTEST.match(line)) and not re.search(r"passed|xfailed", summary["counts"]):
            return f"no test ran: {line.strip()}"
        return ""


def plain_bench(edam: Mapping[str, Any], options: Mapping[str, Any], folder: Path) -> PlainBench:
    """Return the bench of a build in `folder` with these options of its flow and its tool.

    Raise `RuntimeError` if an option is not legal.
    """
    files = edam.get("files", ())
    sources = [*_sources(files, folder)]
    declared = options.get(PASSES_WITH, _HOSTS_PASS if any(file["name"].endswith(_HOSTS) for file in files) else None)
    bench = [text for text in sources if _declares(text, str(edam.get("toplevel", "")))]
    return PlainBench(
        _fails_at(options),
        _pass_text(bench) if declared is None else str(declared),
        declared is not None,
        any(_CHECK.search(text) for text in sources),
        any(_STOP.search(text) for text in sources),
    )


def _fails_at(options: Mapping[str, Any]) -> str:
    if (level := options.get(FAILS_AT)) is not None:
        if level not in SEVERITIES:
            raise RuntimeError(f"the flow option {FAILS_AT} is '{level}'; legal: {', '.join(SEVERITIES)}")
        return str(level)
    words = [word for name in ("sim_options", "run_options") for word in options.get(name, ())]
    levels = [str(word).removeprefix(_ASSERT_LEVEL) for word in words if str(word).startswith(_ASSERT_LEVEL)]
    return levels[-1] if levels and levels[-1] in SEVERITIES else "error"


def _sources(files: Iterable[Mapping[str, Any]], folder: Path) -> Iterable[str]:
    """Yield the texts of a build's sources in VHDL, Verilog and C++, without comments."""
    for file in files:
        kind = str(file.get("file_type", ""))
        if kind.startswith(("vhdlSource", "verilogSource", "systemVerilogSource", "cppSource", "cSource")):
            comment = _COMMENT["vhdl" if kind.startswith("vhdl") else ""]
            text = (folder / str(file["name"])).read_text(encoding="utf-8", errors="replace")
            yield comment.sub(lambda found: found[1] or " ", text)


def _declares(text: str, toplevels: str) -> bool:
    """Return whether a source declares one of the top levels, which may have the name of a library before."""
    names = "|".join(re.escape(name.rpartition(".")[2]) for name in toplevels.split())
    return bool(names) and bool(
        re.search(rf"(?i)\b(?:entity|module|program)\s+(?:static\s+|automatic\s+)?(?:{names})\b", text)
    )


def _pass_text(sources: Iterable[str]) -> str:
    """Return the last text in the sources by which the bench says that it passed, or an empty text.

    The parts between the numbers of a format are texts of their own.
    """
    found = ""
    for text in sources:
        for literal in _STRING.finditer(text):
            for part in _FORMAT.split(literal[1]):
                if _PASS.search(part) and not _reports_failure(part) and not _NO_SUCCESS.search(part):
                    found = part.strip()
    return found


def _reports_failure(line: str) -> bool:
    return any(
        not _NONE_BEFORE.search(line[: found.start()]) and not _NONE_AFTER.match(line[found.end() :])
        for found in _FAILURE.finditer(line)
    )
