"""First versions of what a user then owns: specification, core file, sources of accelerators."""
