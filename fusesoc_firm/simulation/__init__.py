"""What a simulated system receives and should answer, and its simulators."""
