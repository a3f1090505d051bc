"""What FuseSoC and the command line share: the table of generators, and the answer to a call."""
