"""FPGAs for robots: message converters (FIRM) and whole systems (FAR) as FuseSoC cores."""

__version__ = "0.2.0"
