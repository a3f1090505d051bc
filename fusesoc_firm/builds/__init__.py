"""Builds: generator calls, FuseSoC's set-up, the steps of its flows, and the store of their results."""
