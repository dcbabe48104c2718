"""A server on this machine that shows a whole data set in a browser."""
