"""Free-run residuals of a model on recordings, fits with their covariance, predictions, and what is left.

Here belongs what fits or judges one given model. What chooses between effects does not.
"""
