"""What runs beside the hardware: stimuli and expected frames of a simulation."""
