"""The compiled kernel: from a program to its text, and from the text to machine code that is kept on disk.

Here belongs what writes and compiles one step. Which steps are made, and for what, does not.
"""
