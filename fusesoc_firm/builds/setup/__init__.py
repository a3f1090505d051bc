"""The adapter to FuseSoC, and many builds at once."""
