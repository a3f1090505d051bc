"""The stimuli, reference answers and simulators of a system."""
