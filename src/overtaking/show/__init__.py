"""Descriptions of simulations for people: text, figures, reports, films, pages for browsers."""
