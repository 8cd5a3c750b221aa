"""One file a study: each returns plain numbers and the curves that the page draws."""
