"""The command of FuseSoC's generator `firm`."""

import firm_python

firm_python.run("firm")
