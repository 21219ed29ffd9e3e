"""Reference motions and the consecutive compensator."""
