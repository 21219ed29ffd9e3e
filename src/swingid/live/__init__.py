"""The live rig: schema and frames of the link, the device's state machine and guard, devices that are not there.

`firmware/core` is the same machine in C99. Needs the packages of ``pip install 'swingid[live]'``.
"""
