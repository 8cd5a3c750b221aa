"""What a run leaves in files: where it comes from, which files are its own, and the curves that a report draws.

Here belongs what is written about a result. What computes or shows one does not.
"""
