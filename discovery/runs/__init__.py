"""What a command runs: the loop, the stages, the whole pipeline, and campaigns of many cases.

Here belongs the order of things. A method that another order could use does not.
"""
