"""An old tree and the working tree over a corpus of cases, and what differs in their results.

`make compare-with REV=<git revision>`; a tool for refactoring. It leans on nothing but the command line, rig files,
JSON, exit codes and the names of ``import swingid``, so that it runs both trees however the packages are cut.
"""
