"""What a message is on the wire: where every byte of a field lies in a frame, and a codec for frames."""
