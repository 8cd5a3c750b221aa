"""What an effect and a parameter are, the symbols and units they are written in, and the catalogue of them.

Here belongs what a new effect is declared with. No effect and no base does.
"""
