"""The PLL that derives a board's clock from its oscillator, with the cell of the FPGA's family."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

PLL_TEMPLATES = {"trellis": "verilog/pll_ecp5.v"}
"""The template of the cell for each supported flow."""

# The limits of EHXPLLL in Hz: phase detector, input and output, and VCO (FPGA-DS-02012, sysCLOCK PLL timing).
_SLOWEST_COMPARED, _FASTEST = 10 * 10**6, 400 * 10**6
_SLOWEST_VCO, _FASTEST_VCO = 400 * 10**6, 800 * 10**6
_WANTED_VCO = (_SLOWEST_VCO + _FASTEST_VCO) // 2
_LARGEST_DIVISOR = 128


@dataclass(frozen=True)
class Pll:
    """A PLL with its output as feedback; `oscillator` and `clock` are in Hz, all other attributes are divisors."""

    oscillator: Fraction
    clock: Fraction
    input: int
    feedback: int
    output: int

    @property
    def vco(self) -> Fraction:
        """The frequency that `output` divides, in Hz."""
        return self.clock * self.output


def pll_of(oscillator: Fraction, clock: Fraction) -> Pll | None:
    """Return the PLL for exactly `clock` from `oscillator`, both in Hz, or None if its divisors do not allow it.

    Of several solutions, the one with the highest phase-detector frequency, then the VCO nearest to mid-range, is used.
    """
    ratio = clock / oscillator
    if max(ratio.numerator, ratio.denominator) > _LARGEST_DIVISOR:
        return None
    if oscillator / ratio.denominator < _SLOWEST_COMPARED or max(oscillator, clock) > _FASTEST:
        return None
    divisors = range(1, _LARGEST_DIVISOR + 1)
    found = [Pll(oscillator, clock, ratio.denominator, ratio.numerator, divisor) for divisor in divisors]
    legal = (pll for pll in found if _SLOWEST_VCO <= pll.vco <= _FASTEST_VCO)
    return min(legal, key=lambda pll: abs(pll.vco - _WANTED_VCO), default=None)


def pll_configuration(pll: Pll, entity: str) -> dict[str, Any]:
    """Return the configuration of a PLL's template, and of the top level with it."""
    return {
        "entity": entity,
        "oscillator_mhz": megahertz(pll.oscillator),
        "clock_mhz": megahertz(pll.clock),
        "vco_mhz": megahertz(pll.vco),
        "input": pll.input,
        "feedback": pll.feedback,
        "output": pll.output,
    }


def megahertz(hertz: Fraction) -> str:
    """Return a frequency in MHz as a decimal number."""
    return f"{float(hertz) / 10**6:.10g}"
