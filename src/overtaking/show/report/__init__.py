"""The report on a data set: one page that needs no network, its figures and its tables as files."""
