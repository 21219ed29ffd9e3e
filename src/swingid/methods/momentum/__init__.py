"""The momentum method: modulating functions on the angles; no motor constant, no speed, no friction law."""
