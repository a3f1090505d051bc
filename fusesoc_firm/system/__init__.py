"""FAR: from a system specification to a system in which every port, id and connection is known."""
