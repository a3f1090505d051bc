"""A system's program for a processor, run on an emulated board in front of the simulated hardware."""
