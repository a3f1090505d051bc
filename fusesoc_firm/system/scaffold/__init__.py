"""First versions of a user's own files: specification, core file, accelerator sources."""
