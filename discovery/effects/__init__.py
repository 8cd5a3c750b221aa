"""One physical effect a file; siblings do not know each other.

Here belongs what is true of any base. What several effects share does not.
"""
