"""Definitions in `.idl` files and in bags' schemas: the part of OMG IDL 4.2 that rosidl reads, and enums."""
