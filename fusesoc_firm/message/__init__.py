"""What a message is: its model, the parser of `.msg` text, and where definitions come from."""
