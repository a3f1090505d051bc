"""The specification as its author wrote it."""
