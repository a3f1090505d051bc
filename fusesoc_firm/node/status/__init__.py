"""The status of the hardware, and its exchange with other programs."""
