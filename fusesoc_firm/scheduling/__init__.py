"""Schedulers: cycle-exact models of those in hardware."""
