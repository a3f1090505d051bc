"""Overlays for PYNQ: the package that `firm pynq` writes, and the driver on which it is based."""
