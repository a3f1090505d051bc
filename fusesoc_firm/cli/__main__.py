"""`python -m fusesoc_firm.cli`."""

import sys

from fusesoc_firm.cli import main

sys.exit(main())
