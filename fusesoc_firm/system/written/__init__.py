"""The system as its author wrote it."""
