"""What was measured: recordings read, checked and told of, their smooth input, and the data set of a run.

Here belongs what makes a file ready for a simulation or a regression. What knows a model does not.
"""
