"""Python interface: messages and systems in scripts and notebooks."""
