"""Diagnostics with source positions, identifiers, templates, YAML and files."""
