"""The figures of the report, one per file; each draws what its data allow and returns None where there are none."""
