"""Whether intervals cover as often as they say: on the model's own data, and on an arm that no model is."""
