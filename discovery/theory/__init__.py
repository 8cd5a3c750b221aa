"""What first principles say of the arm: static elastica, third order, prediction from the rig.

Here belongs what is derived. What is measured or selected does not.
"""
