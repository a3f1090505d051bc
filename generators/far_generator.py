"""The command of FuseSoC's generator `far`."""

import firm_python

firm_python.run("far")
