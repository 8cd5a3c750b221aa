"""What first principles say of the arm: the static elastica, the massless arm, the drivetrain, the third order.

Here belongs what is derived. What is measured or selected does not.
"""
