"""All that is proved."""

from __future__ import annotations

from tools.proofs import manager, memories, parts, schedulers

PROOFS = (*manager.PROOFS, *parts.PROOFS, *memories.PROOFS, *schedulers.PROOFS)
