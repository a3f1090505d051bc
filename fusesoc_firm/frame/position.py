"""Positions in a payload that are known only by their residues modulo the largest alignment."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Position:
    """A position whose possible values modulo `modulus` are `residues`; alignments divide `modulus`."""

    modulus: int
    residues: frozenset[int]

    def advanced(self, size: int) -> Position:
        """The position after `size` bytes."""
        return self._of({residue + size for residue in self.residues})

    def padding(self, alignment: int) -> int | None:
        """The bytes up to a multiple of `alignment`, or None if they depend on the position at run time."""
        paddings = {-residue % alignment for residue in self.residues}
        return paddings.pop() if len(paddings) == 1 else None

    def aligned(self, alignment: int) -> Position:
        """The position after padding to a multiple of `alignment`."""
        return self._of({residue + -residue % alignment for residue in self.residues})

    def repeated(self, size: int, most: int | None) -> Position:
        """The position after 0 to `most` values of `size` bytes; None means any number of them."""
        # After `modulus` values the residues repeat.
        largest = self.modulus if most is None else min(most, self.modulus)
        return self._of({residue + number * size for residue in self.residues for number in range(largest + 1)})

    def joined(self, other: Position) -> Position:
        """The position if either of the two is possible."""
        return self._of(self.residues | other.residues)

    def _of(self, residues: set[int] | frozenset[int]) -> Position:
        return Position(self.modulus, frozenset(residue % self.modulus for residue in residues))
