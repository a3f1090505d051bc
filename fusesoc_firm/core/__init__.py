"""A generator call's parameters, and the core that answers it."""
