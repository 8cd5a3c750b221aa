"""The dashboard over all runs: a card for each with its verdict, a picture, and the error before and after.

Run it as ``python -m benchmarks.dashboard FOLDER``, where each run has a folder of its own in FOLDER.
"""
