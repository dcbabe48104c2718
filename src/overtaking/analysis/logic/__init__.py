"""Data sets as logic: facts, a background theory, questions, and the law a second time.

Everything is an integer of a declared unit, and no term of a program can leave 32 bits.
"""
