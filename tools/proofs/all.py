"""All that is proved."""

from __future__ import annotations

from tools.proofs import manager, memories, noc, parts, schedulers

PROOFS = (*manager.PROOFS, *parts.PROOFS, *noc.PROOFS, *memories.PROOFS, *schedulers.PROOFS)
