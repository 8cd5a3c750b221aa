"""The blind benchmark: generated cases with sealed truth, the loop and its peers on them, and the scores."""
