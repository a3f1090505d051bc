"""Cycle-exact models of the hardware schedulers, and response-time analysis."""
