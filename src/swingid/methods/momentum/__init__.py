"""The symmetric momentum method: test functions on the angles, no motor constant, no speed, no law."""
