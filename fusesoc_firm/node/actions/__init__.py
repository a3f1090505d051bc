"""Actions in hardware: servers and clients."""
