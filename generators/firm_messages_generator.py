"""The command of FuseSoC's generator `firm_messages`."""

import firm_python

firm_python.run("firm_messages")
