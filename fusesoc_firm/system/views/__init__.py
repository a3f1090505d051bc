"""The derived system for people: listings, pictures and reports."""
