"""FIRM: converters between messages and AXI-Stream, from a frame and a stream width."""
