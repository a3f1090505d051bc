"""What was generated, kept by the digest of what decides it."""
