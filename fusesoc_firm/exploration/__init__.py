"""The report of a compiled accelerator, and the exploration of its operators and numbers."""
