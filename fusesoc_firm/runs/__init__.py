"""Runs of generated hardware on stimuli and bags: simulations, replays, emulated programs and verifications."""
