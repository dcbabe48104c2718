"""Ego-centred signals of any recording: who is around, how far, how fast, how far one sees.

`engine` works them out for everybody; `reference` is the same as a person reads it, and `target`
has those of the vehicle that is overtaken.
"""
