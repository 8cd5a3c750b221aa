"""A corpus of bad input and faults: what `discovery loop` makes of each case, as a table of outcomes."""
