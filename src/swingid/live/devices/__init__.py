"""Devices that a host connects to, one per file.

A device is a stream of bytes: ``write(data)``, ``read(timeout) -> bytes``, ``close()``.
"""
