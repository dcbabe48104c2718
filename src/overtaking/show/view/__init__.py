"""One page that shows simulations in a browser, from disk and without a network."""
