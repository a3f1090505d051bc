"""Recorded data: from topics to the messages of a system, and back into a bag."""
