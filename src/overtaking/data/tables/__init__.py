"""The tables of a data set: columns with units, files, and the way from memory and back."""
