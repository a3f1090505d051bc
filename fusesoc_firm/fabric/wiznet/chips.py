"""The models of the chips by their numbers."""

from __future__ import annotations

from collections.abc import Callable

from fusesoc_firm.fabric.wiznet.w5200 import W5200
from fusesoc_firm.fabric.wiznet.w5500 import W5500

MODELS: dict[int, Callable[[], W5200 | W5500]] = {5200: W5200, 5500: W5500}
