"""What a call of a generator asks for, and the core that answers it."""
