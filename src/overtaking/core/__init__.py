"""Basis of all other packages: arrays, errors, files, random numbers, processes.

arrays: array types with their dtypes, and a pool that reuses the memory of large arrays.
equality: equality by content for objects that hold arrays, tables and NaN.
errors: error classes with one message format, checks of arguments, packages of extras.
files: reading up to a size; writing that leaves complete files and folders only.
float32_math: elementary functions in float32 that have the same bits on every machine.
native: the functions of float32_math and random_numbers, compiled.
notebook: output in IPython: HTML messages, and the progress of long calls below a cell.
process_limits: limits of processors, threads, memory and time, and pools of threads.
progress: progress of work that has several parts.
random_numbers: counter-based random numbers (Philox 4x32-10).
representation: objects as JSON values, short `repr`, texts that UTF-8 can hold.
units: suffixes of names, units of recorded integers, conversion to SI.
worker_process: child processes that run a module and exchange messages.
"""
