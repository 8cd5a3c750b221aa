"""A campaign of many small rigs whose workers are killed at random."""
