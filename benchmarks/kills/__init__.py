"""Commands that are killed at random moments, that meet in one folder, or that find an empty cache."""
