"""FAR: from a system specification to a complete system."""
