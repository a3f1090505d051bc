"""FIRM: from a Frame to the configuration of a converter's template."""
