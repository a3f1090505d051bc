"""What is known of a position in a payload before there is a payload: its residues modulo the largest alignment."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Position:
    """A position of which only `residues` modulo `modulus` are possible; alignments divide `modulus`."""

    modulus: int
    residues: frozenset[int]

    def advanced(self, size: int) -> Position:
        """Behind `size` bytes."""
        return self._of({residue + size for residue in self.residues})

    def padding(self, alignment: int) -> int | None:
        """The bytes up to a multiple of `alignment`, or None if that depends on the run."""
        paddings = {-residue % alignment for residue in self.residues}
        return paddings.pop() if len(paddings) == 1 else None

    def aligned(self, alignment: int) -> Position:
        """Behind padding to a multiple of `alignment`."""
        return self._of({residue + -residue % alignment for residue in self.residues})

    def repeated(self, size: int, most: int | None) -> Position:
        """Behind 0 to `most` values of `size` bytes; None is any number of them."""
        # After `modulus` values the residues repeat.
        largest = self.modulus if most is None else min(most, self.modulus)
        return self._of({residue + number * size for residue in self.residues for number in range(largest + 1)})

    def joined(self, other: Position) -> Position:
        """What is known if either may be the case."""
        return self._of(self.residues | other.residues)

    def _of(self, residues: set[int] | frozenset[int]) -> Position:
        return Position(self.modulus, frozenset(residue % self.modulus for residue in residues))
