"""Numbers about a labelled data set: what tables print and what figures draw, computed here.

Everything reads one frame with a row per simulation, the paper's fifteen features and CLASS.
Nothing here draws, reads files or chooses colours.
"""
