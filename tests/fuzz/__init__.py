"""Mutation fuzzing of everything that reads a file of a user.

`corpus`: valid files of every format. `mutations`: what becomes of them. `cases`: one case, judged. `batch`: many cases
in a process of their own, watched for hangs, crashes and memory.
"""
