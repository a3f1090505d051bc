"""How frames travel between the host's software and hardware, simulated or not (docs/reference/transports.md)."""
