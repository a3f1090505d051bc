"""All that is proved."""

from __future__ import annotations

from tools.proofs import manager, parts, schedulers

PROOFS = (*manager.PROOFS, *parts.PROOFS, *schedulers.PROOFS)
