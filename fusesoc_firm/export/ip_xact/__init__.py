"""A component as IP-XACT, for block designs."""
