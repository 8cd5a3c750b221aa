"""Pictures of data sets and results on matplotlib axes, drawn from what a result holds; nothing is computed here.

The methods ``plot_*`` of data sets and results call these functions; matplotlib is imported when the first is drawn.
"""
