"""Every effect of the catalogue tried beside a fitted model: first by its response alone, then refitted.

Here belongs what tells what a candidate would explain. What decides between candidates does not.
"""
