"""All that is proved."""

from __future__ import annotations

from tests.proofs import manager, schedulers

PROOFS = (*manager.PROOFS, *schedulers.PROOFS)
