"""Positions in a payload, of which only the residues modulo the largest alignment are known."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Position:
    """A position whose possible residues modulo `modulus` are `residues`; every alignment divides `modulus`."""

    modulus: int
    residues: frozenset[int]

    def advanced(self, size: int) -> Position:
        """Return the position after `size` bytes."""
        return self._of({residue + size for residue in self.residues})

    def padding(self, alignment: int) -> int | None:
        """Return the number of bytes up to a multiple of `alignment`, or None if it is known only at run time."""
        paddings = {-residue % alignment for residue in self.residues}
        return paddings.pop() if len(paddings) == 1 else None

    def aligned(self, alignment: int) -> Position:
        """Return the position after padding to a multiple of `alignment`."""
        return self._of({residue + -residue % alignment for residue in self.residues})

    def repeated(self, size: int, most: int | None) -> Position:
        """Return the position after 0 to `most` values of `size` bytes; None means any number of values."""
        # After `modulus` values, the residues repeat.
        largest = self.modulus if most is None else min(most, self.modulus)
        return self._of({residue + number * size for residue in self.residues for number in range(largest + 1)})

    def joined(self, other: Position) -> Position:
        """Return a position whose possible residues are those of both positions."""
        return self._of(self.residues | other.residues)

    def _of(self, residues: set[int] | frozenset[int]) -> Position:
        return Position(self.modulus, frozenset(residue % self.modulus for residue in residues))
