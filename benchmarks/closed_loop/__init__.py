"""A controller tuned on the discovered model against one tuned on the declared model, in a loop with the twin."""
