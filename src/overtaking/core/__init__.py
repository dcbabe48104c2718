"""Basis of all other packages: arrays, errors, files, random numbers, processes.

arrays: array types with their dtypes; memory of large arrays is reused.
equality: equality by content for objects that hold arrays, tables and NaN.
errors: error classes, their one message format, checks of names and numbers, extras.
files: bounded reading; atomic writing of files and folders.
float32_math: elementary functions in float32 that have the same bits on every machine.
intervals: confidence intervals of counted shares.
native: the same functions and random numbers by the compiled engine.
notebook: output of IPython: links, and progress below the running cell of a notebook.
process_limits: processors, threads, memory and time that this process or a query may use.
progress: progress of work that has several parts.
random_numbers: counter-based random numbers (Philox 4x32-10).
representation: objects as JSON values, one-line representations, counts in words.
units: suffixes of names, integer units, conversion to SI.
worker_process: a module that runs in a child process, and its messages; both ends.
"""
