"""Mutations of one line each: how many of them do the tests notice?

`python -m tests.mutations cover` runs every test file once, alone, and writes which lines of the package it executes;
`python -m tests.mutations try --count 200` breaks lines at random and runs the test files that execute them, nearest first.

Why not a library: mutmut forks a process that has jax's threads in it, cosmic-ray runs one command for all mutants, and neither
leaves out what no test of physics is to see (messages, annotations, checks of input).
"""
