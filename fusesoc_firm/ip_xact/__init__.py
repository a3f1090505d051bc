"""A core's target as an IP-XACT component, for block designs."""
