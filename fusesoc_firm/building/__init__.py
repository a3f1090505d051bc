"""Many builds at once: FuseSoC for several cores and targets, each alone in its place in the build root."""
