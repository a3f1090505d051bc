"""Faults with places, names, templates, files and YAML that keeps its places."""
