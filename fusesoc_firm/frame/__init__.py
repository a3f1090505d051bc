"""The layout of a message on the wire, and a codec for frames."""
