"""The answer to a generator call, for FuseSoC and for the command line."""
