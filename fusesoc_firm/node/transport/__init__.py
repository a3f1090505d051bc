"""How frames get between the host's software and the hardware, be it simulated or not (docs/transport.md)."""
