"""Converters verified in simulation against independent serialisers."""
