"""The ways of a system into other frameworks: IP-XACT, LiteX, Amaranth and PYNQ."""
