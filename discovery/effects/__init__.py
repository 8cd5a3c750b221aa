"""One physical effect a file; siblings do not know each other."""
