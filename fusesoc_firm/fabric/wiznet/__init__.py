"""Behavioural models of WIZnet's W5500 and W5200, and simulated boards with them."""
