"""Identification: one method per file, sharing nodes, turning points, results, uncertainty."""
