"""Listings, pictures and reports of a derived system."""
